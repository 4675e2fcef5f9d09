// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include "airfield.hpp"

namespace emit::scenegen {
namespace {

struct Patch {
  double x0, y0, x1, y1;
  const char* material;
};

/// Plan of rectangles on one surface, where later ones lie on top. The surface is cut along all
/// their lines, so that no rectangle lies on another and no edge meets another in a T.
class PatchPlan {
 public:
  void add(double x0, double y0, double x1, double y1, const char* material) {
    patches_.push_back({x0, y0, x1, y1, material});
  }

  [[nodiscard]] SceneMesh mesh(const std::string& name) const {
    const std::vector<double> xs = lines(&Patch::x0, &Patch::x1);
    const std::vector<double> ys = lines(&Patch::y0, &Patch::y1);
    std::map<std::string, Part> parts;
    std::map<std::string, std::map<std::size_t, std::uint32_t>> vertices;
    const auto vertex = [&](const std::string& material, std::size_t i, std::size_t j) {
      Part& part = parts[material];
      const auto [entry, is_new] = vertices[material].emplace(
          j * xs.size() + i, static_cast<std::uint32_t>(part.positions_m.size()));
      if (is_new) {
        part.positions_m.emplace_back(static_cast<float>(xs[i]), static_cast<float>(ys[j]), 0.0F);
        part.normals.emplace_back(0.0F, 0.0F, 1.0F);
      }
      return entry->second;
    };
    for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
      for (std::size_t i = 0; i + 1 < xs.size(); ++i) {
        const char* material = top_at(0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1]));
        if (material == nullptr) {
          continue;
        }
        const std::uint32_t a = vertex(material, i, j);
        const std::uint32_t b = vertex(material, i + 1, j);
        const std::uint32_t c = vertex(material, i + 1, j + 1);
        const std::uint32_t d = vertex(material, i, j + 1);
        std::vector<std::uint32_t>& indices = parts[material].indices;
        indices.insert(indices.end(), {a, b, c, a, c, d});
      }
    }
    SceneMesh mesh;
    mesh.name = name;
    for (auto& [material, part] : parts) {
      part.material = material;
      mesh.parts.push_back(part);
    }
    return mesh;
  }

 private:
  [[nodiscard]] std::vector<double> lines(double Patch::*low, double Patch::*high) const {
    std::vector<double> values;
    for (const Patch& patch : patches_) {
      values.push_back(patch.*low);
      values.push_back(patch.*high);
    }
    std::sort(values.begin(), values.end());
    // Lines that are nearer than a millimetre become one.
    values.erase(std::unique(values.begin(), values.end(),
                             [](double a, double b) { return std::abs(a - b) < 1e-3; }),
                 values.end());
    return values;
  }

  [[nodiscard]] const char* top_at(double x, double y) const {
    for (auto patch = patches_.rbegin(); patch != patches_.rend(); ++patch) {
      if (x > patch->x0 && x < patch->x1 && y > patch->y0 && y < patch->y1) {
        return patch->material;
      }
    }
    return nullptr;
  }

  std::vector<Patch> patches_;
};

constexpr const char* kPaint = "paint_white";
constexpr double kRunwaySouth = -272.5;
constexpr double kRunwayNorth = -227.5;

void add_runway(PatchPlan& plan) {
  plan.add(-495.0, kRunwaySouth - 7.5, 495.0, kRunwayNorth + 7.5, "gravel");
  plan.add(-480.0, kRunwaySouth, 480.0, kRunwayNorth, "asphalt");
  for (double x = -380.0; x < 360.0; x += 50.0) {  // centre line, 30 m on, 20 m off
    plan.add(x, -250.5, x + 30.0, -249.5, kPaint);
  }
  for (const double end : {-1.0, 1.0}) {
    const double a = end * 470.0;
    const double b = end * 440.0;
    for (const double y : {-267.0, -261.0, -255.0, -247.0, -241.0, -235.0}) {  // piano keys
      plan.add(std::min(a, b), y, std::max(a, b), y + 2.0, kPaint);
    }
  }
}

void add_taxiways(PatchPlan& plan) {
  for (const double x : {-400.0, 0.0, 400.0}) {
    plan.add(x - 12.0, kRunwayNorth, x + 12.0, -100.0, "asphalt");
  }
  plan.add(-480.0, -110.0, 480.0, -90.0, "asphalt");
  for (const double x : {-100.0, 100.0}) {
    plan.add(x - 12.0, -100.0, x + 12.0, 30.0, "asphalt");
    plan.add(x - 0.2, -100.0, x + 0.2, 30.0, kPaint);
  }
  plan.add(-480.0, -100.2, 480.0, -99.8, kPaint);
}

void add_apron(PatchPlan& plan) {
  plan.add(-220.0, 20.0, 220.0, 140.0, "asphalt");
  plan.add(-220.0, 138.0, 220.0, 146.0, "concrete");  // strip before the hangars
  for (const double x : {-150.0, -50.0, 50.0, 150.0}) {
    plan.add(x - 22.0, 144.0, x + 22.0, 190.0, "concrete");  // hangar floors
  }
  plan.add(-220.0, 40.0, 220.0, 40.3, kPaint);  // edge of the manoeuvring area
  for (const double x :
       {-180.0, -140.0, -60.0, 60.0, 140.0, 180.0}) {  // lead-in lines of the stands
    plan.add(x - 0.15, 40.0, x + 0.15, 110.0, kPaint);
    plan.add(x - 3.0, 109.7, x + 3.0, 110.0, kPaint);
  }
  // Add the service bay of the demo's truck, of concrete slabs within the asphalt.
  plan.add(-40.0, 95.0, 40.0, 115.0, "concrete");
}

void add_roads(PatchPlan& plan) {
  plan.add(-490.0, 225.0, 490.0, 233.0, "asphalt");
  plan.add(236.0, 140.0, 244.0, 229.0, "asphalt");
  plan.add(215.0, 60.0, 244.0, 68.0, "asphalt");
  plan.add(236.0, 60.0, 244.0, 145.0, "asphalt");
  plan.add(280.0, 150.0, 360.0, 200.0, "asphalt");  // car park
  plan.add(244.0, 170.0, 285.0, 178.0, "asphalt");
  plan.add(-330.0, 70.0, -270.0, 110.0, "gravel");  // fuel farm
  plan.add(-275.0, 84.0, -215.0, 92.0, "asphalt");
}

}  // namespace

void add_ground(Scene& scene) {
  PatchPlan plan;
  // Add fields far around the fence for views from high above. They cost one cell each.
  plan.add(-3000.0, -3000.0, 3000.0, 3000.0, "grass");
  plan.add(-3000.0, 700.0, -600.0, 1900.0, "soil");
  plan.add(900.0, 600.0, 2400.0, 3000.0, "soil");
  plan.add(-1500.0, -2200.0, 400.0, -900.0, "soil");
  plan.add(1100.0, -1700.0, 3000.0, -600.0, "soil");
  plan.add(-500.0, -500.0, 500.0, 500.0, "grass");
  add_runway(plan);
  add_taxiways(plan);
  add_apron(plan);
  add_roads(plan);
  scene.place(scene.add_mesh(plan.mesh("ground")), "ground");
}

}  // namespace emit::scenegen
