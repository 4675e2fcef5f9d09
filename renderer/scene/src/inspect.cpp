// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/inspect.hpp"
#include "emit/scene/sheets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <iterator>
#include <utility>

#include "emit/scene/gltf_import.hpp"

namespace emit::scene {
namespace {

double area_m2(const Mesh& mesh, const Submesh& submesh, const glm::dmat4& target_from_mesh) {
  double area = 0.0;
  const auto point = [&](std::uint32_t i) {
    return glm::dvec3(target_from_mesh *
                      glm::dvec4(glm::dvec3(mesh.positions_m[mesh.indices[i]]), 1.0));
  };
  for (std::uint32_t i = submesh.first_index; i < submesh.first_index + submesh.index_count;
       i += 3) {
    const glm::dvec3 a = point(i);
    area += 0.5 * glm::length(glm::cross(point(i + 1) - a, point(i + 2) - a));
  }
  return area;
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned int>(c));
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string joined(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& part : parts) {
    out += out.empty() ? part : ", " + part;
  }
  return out;
}

}  // namespace

physics::Result<SceneSummary> inspect_gltf(const std::filesystem::path& file,
                                           std::span<const Material> library) {
  physics::Result<GltfModel> model = import_gltf(file);
  if (!model) {
    return tl::unexpected(std::move(model.error()));
  }
  SceneSummary summary;
  summary.file = file;
  summary.nodes = model->nodes;
  summary.placements = static_cast<std::uint32_t>(model->placements.size());
  summary.dropped_triangles = model->dropped_triangles;
  summary.warnings = model->warnings;
  for (const Mesh& mesh : model->meshes) {
    summary.vertices += mesh.positions_m.size();
    summary.meshes.push_back({mesh.name, mesh.indices.size() / 3, mesh.positions_m.size(),
                              static_cast<std::uint32_t>(mesh.submeshes.size()), 0});
  }
  const auto in_library = [&](const std::string& name) {
    return std::any_of(library.begin(), library.end(),
                       [&](const Material& m) { return m.name == name; });
  };
  std::vector<SceneSummary::MaterialRow> rows;
  for (const GltfMaterial& material : model->materials) {
    rows.push_back({material.name,
                    in_library(material.name) ? material.name : "",
                    material.double_sided,
                    0,
                    0.0,
                    0,
                    {}});
  }
  if (const auto images = gltf_colours(file)) {
    for (const GltfColours& image : *images) {
      const auto row =
          std::ranges::find(rows, image.gltf_material, &SceneSummary::MaterialRow::gltf_material);
      if (row == rows.end()) continue;
      for (const GltfColours::Share& share : image.colours) {
        row->colours.emplace_back(
            fmt::format("#{:02x}{:02x}{:02x}", share.rgb[0], share.rgb[1], share.rgb[2]),
            share.frac);
      }
    }
  }
  rows.push_back({});
  std::vector<char> thin;
  for (const SceneSummary::MaterialRow& row : rows) {
    thin.push_back(std::ranges::any_of(library, [&](const Material& m) {
      return m.name == row.library_material && sheet_of(m).has_value();
    }));
  }
  std::vector<char> open;
  for (const Mesh& mesh : model->meshes) open.push_back(may_have_sheets(mesh));
  for (const GltfPlacement& placement : model->placements) {
    const Mesh& mesh = model->meshes[placement.mesh];
    const glm::dmat4 body_from_mesh = body_from_gltf() * placement.gltf_from_mesh;
    ++summary.meshes[placement.mesh].placements;
    summary.triangles += mesh.indices.size() / 3;
    summary.bounds_body.add(transformed(mesh.bounds, body_from_mesh));
    for (const Submesh& submesh : mesh.submeshes) {
      const std::size_t index = std::min<std::size_t>(submesh.material, rows.size() - 1);
      SceneSummary::MaterialRow& row = rows[index];
      if (submesh.double_sided && open[placement.mesh] != 0 && thin[index] != 0) {
        row.sheet_triangles += submesh.index_count / 3;
      }
      row.triangles += submesh.index_count / 3;
      row.area_m2 += area_m2(mesh, submesh, body_from_mesh);
    }
  }
  if (rows.back().triangles == 0) {
    rows.pop_back();
  }
  if (!library.empty()) {
    for (const SceneSummary::MaterialRow& row : rows) {
      if (row.triangles > 0 && row.library_material.empty()) {
        summary.warnings.push_back(row.gltf_material.empty()
                                       ? file.filename().string() + ": geometry without material"
                                       : fmt::format("{}: material '{}' is not in the library",
                                                     file.filename().string(), row.gltf_material));
      }
    }
  }
  summary.materials = std::move(rows);
  return summary;
}

std::string to_text(const SceneSummary& summary) {
  std::string out;
  auto put = std::back_inserter(out);
  fmt::format_to(put, "{}\n", summary.file.string());
  fmt::format_to(put, "nodes       {}\nplacements  {}\ntriangles   {}\nvertices    {}\n",
                 summary.nodes, summary.placements, summary.triangles, summary.vertices);
  if (summary.dropped_triangles > 0) {
    fmt::format_to(put, "dropped     {} triangles of zero area\n", summary.dropped_triangles);
  }
  const Aabb& box = summary.bounds_body;
  if (!box.empty()) {
    fmt::format_to(put,
                   "bounds      forward {:.3f} .. {:.3f} m, right {:.3f} .. {:.3f} m, up {:.3f} .. "
                   "{:.3f} m\n",
                   box.min_m.x, box.max_m.x, box.min_m.y, box.max_m.y, 0.0 - box.max_m.z,
                   0.0 - box.min_m.z);
  }
  fmt::format_to(put, "meshes\n");
  for (const SceneSummary::MeshRow& row : summary.meshes) {
    fmt::format_to(put,
                   "  {:<32} {:>9} triangles {:>9} vertices {:>3} submeshes {:>5} placements\n",
                   row.name, row.triangles, row.vertices, row.submeshes, row.placements);
  }
  fmt::format_to(put, "materials\n");
  for (const SceneSummary::MaterialRow& row : summary.materials) {
    fmt::format_to(put, "  {:<32} {:>9} triangles {:>12.{}f} m2  {}{}\n",
                   row.gltf_material.empty() ? "(none)" : row.gltf_material, row.triangles,
                   row.area_m2, row.area_m2 < 1.0 ? 6 : 2,
                   row.library_material.empty() ? "not in the library" : "in the library",
                   row.sheet_triangles > 0
                       ? fmt::format(", double sided: {} triangles are sheets", row.sheet_triangles)
                   : row.double_sided ? ", double sided"
                                      : "");
    if (row.colours.empty()) continue;
    fmt::format_to(put, "    image:");
    for (const auto& [colour, frac] : row.colours) {
      fmt::format_to(put, " {} {:.1f} %", colour, 100.0 * frac);
    }
    fmt::format_to(put, "\n");
  }
  for (const std::string& warning : summary.warnings) {
    fmt::format_to(put, "warning: {}\n", warning);
  }
  return out;
}

std::string to_json(const SceneSummary& summary) {
  std::vector<std::string> meshes;
  for (const SceneSummary::MeshRow& row : summary.meshes) {
    meshes.push_back(fmt::format(
        R"({{"name": {}, "triangles": {}, "vertices": {}, "submeshes": {}, "placements": {}}})",
        quoted(row.name), row.triangles, row.vertices, row.submeshes, row.placements));
  }
  std::vector<std::string> materials;
  for (const SceneSummary::MaterialRow& row : summary.materials) {
    std::vector<std::string> colours;
    for (const auto& [colour, frac] : row.colours) {
      colours.push_back(fmt::format(R"({{"rgb": "{}", "frac": {:.6g}}})", colour, frac));
    }
    materials.push_back(fmt::format(
        R"({{"gltf_material": {}, "library_material": {}, "double_sided": {}, "triangles": {}, "area_m2": {:.9g}, "sheet_triangles": {}, "image_colours": [{}]}})",
        quoted(row.gltf_material),
        row.library_material.empty() ? "null" : quoted(row.library_material), row.double_sided,
        row.triangles, row.area_m2, row.sheet_triangles, joined(colours)));
  }
  std::vector<std::string> warnings;
  std::transform(summary.warnings.begin(), summary.warnings.end(), std::back_inserter(warnings),
                 quoted);
  std::string bounds = "null";
  if (const Aabb& box = summary.bounds_body; !box.empty()) {
    bounds =
        fmt::format(R"({{"min_m": [{:.9g}, {:.9g}, {:.9g}], "max_m": [{:.9g}, {:.9g}, {:.9g}]}})",
                    box.min_m.x, box.min_m.y, box.min_m.z, box.max_m.x, box.max_m.y, box.max_m.z);
  }
  return fmt::format(
      R"({{"file": {}, "nodes": {}, "placements": {}, "triangles": {}, "vertices": {}, )"
      R"("dropped_triangles": {}, "meshes": [{}], "materials": [{}], "warnings": [{}], )"
      R"("bounds_body": {}}})",
      quoted(summary.file.string()), summary.nodes, summary.placements, summary.triangles,
      summary.vertices, summary.dropped_triangles, joined(meshes), joined(materials),
      joined(warnings), bounds);
}

}  // namespace emit::scene
