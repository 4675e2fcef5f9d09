// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <geos_c.h>

#include <glm/ext/vector_double2.hpp>
#include <memory>
#include <span>
#include <vector>

namespace emit::scene {

/// A context of the geometry library, and what it makes.
class Geos {
 public:
  struct Free {
    GEOSContextHandle_t context;
    void operator()(GEOSGeometry* g) const { GEOSGeom_destroy_r(context, g); }
  };
  using Shape = std::unique_ptr<GEOSGeometry, Free>;

  // The library is silent, because it gets no handlers for messages; every result is looked at.
  Geos() : context_(GEOS_init_r()) {}
  ~Geos() { GEOS_finish_r(context_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;

  [[nodiscard]] GEOSContextHandle_t get() const { return context_; }
  [[nodiscard]] Shape own(GEOSGeometry* shape) const { return Shape(shape, Free{context_}); }

  [[nodiscard]] GEOSCoordSequence* sequence(std::span<const glm::dvec2> points) const {
    GEOSCoordSequence* out =
        GEOSCoordSeq_create_r(context_, static_cast<unsigned int>(points.size()), 2);
    for (unsigned int i = 0; i < points.size(); ++i) {
      GEOSCoordSeq_setXY_r(context_, out, i, points[i].x, points[i].y);
    }
    return out;
  }
  [[nodiscard]] Shape line(std::span<const glm::dvec2> points) const {
    return own(GEOSGeom_createLineString_r(context_, sequence(points)));
  }
  /// Joins shapes to a collection of a kind, which owns them.
  [[nodiscard]] Shape collection(int kind, std::vector<Shape> shapes) const {
    std::vector<GEOSGeometry*> raw;
    raw.reserve(shapes.size());
    for (Shape& shape : shapes) raw.push_back(shape.release());
    return own(GEOSGeom_createCollection_r(context_, kind, raw.data(),
                                           static_cast<unsigned int>(raw.size())));
  }
  /// Corners of a line or ring, in its order.
  [[nodiscard]] std::vector<glm::dvec2> points_of(const GEOSGeometry* line) const {
    const GEOSCoordSequence* sequence = GEOSGeom_getCoordSeq_r(context_, line);
    unsigned int size = 0;
    std::vector<glm::dvec2> out;
    if (sequence == nullptr || GEOSCoordSeq_getSize_r(context_, sequence, &size) != 1) return out;
    out.resize(size);
    for (unsigned int i = 0; i < size; ++i) {
      GEOSCoordSeq_getXY_r(context_, sequence, i, &out[i].x, &out[i].y);
    }
    return out;
  }
  [[nodiscard]] double area(const GEOSGeometry* shape) const {
    double area = 0.0;
    return shape != nullptr && GEOSArea_r(context_, shape, &area) == 1 ? area : 0.0;
  }

  /// Calls for every polygon in a shape, which may be a collection of collections.
  template <typename F>
  void each_polygon(const GEOSGeometry* shape, const F& call) const {
    const int kind = GEOSGeomTypeId_r(context_, shape);
    if (kind == GEOS_POLYGON) {
      if (GEOSisEmpty_r(context_, shape) == 0) call(shape);
      return;
    }
    if (kind < GEOS_MULTIPOINT) return;
    const int parts = GEOSGetNumGeometries_r(context_, shape);
    for (int i = 0; i < parts; ++i) each_polygon(GEOSGetGeometryN_r(context_, shape, i), call);
  }

 private:
  GEOSContextHandle_t context_;
};

}  // namespace emit::scene
