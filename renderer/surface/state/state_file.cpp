// SPDX-License-Identifier: Apache-2.0
#include "surface/state/state_file.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "surface/mesh/sheet_sides.hpp"
#include "surface/state/file_sink.hpp"
#include "surface/state/state_bytes.hpp"

namespace emit::renderer {

// Lists of members in the order of the file. They stand beside put_value() in the namespace, so
// that it finds them.
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, RefinedMesh::Vertex>
void visit_members(T& v, const Visit& visit) {
  visit(v.position_m), visit(v.normal), visit(v.material), visit(v.sheet), visit(v.parent);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, RefinedMesh::Parts>
void visit_members(T& p, const Visit& visit) {
  visit(p.vertices), visit(p.leaves), visit(p.leaf_submesh), visit(p.leaf_node), visit(p.nodes);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, scene::Cluster>
void visit_members(T& c, const Visit& visit) {
  visit(c.first_index), visit(c.index_count), visit(c.centre_m), visit(c.radius_m);
  visit(c.box_centre_m), visit(c.box_half_m);
  visit(c.cone_apex_m), visit(c.cone_axis), visit(c.cone_cutoff);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, LevelError>
void visit_members(T& e, const Visit& visit) {
  visit(e.deviation_m), visit(e.size_m), visit(e.edge_m), visit(e.centre_m), visit(e.radius_m);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, ClusterLevel>
void visit_members(T& l, const Visit& visit) {
  visit(l.own), visit(l.coarser), visit(l.has_coarser);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, ClusterLevels::Range>
void visit_members(T& r, const Visit& visit) {
  visit(r.first), visit(r.count);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, DrawnMesh>
void visit_members(T& m, const Visit& visit) {
  visit(m.indices), visit(m.levels.clusters), visit(m.levels.levels), visit(m.levels.of_submesh);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, RefineView::Eye>
void visit_members(T& e, const Visit& visit) {
  visit(e.world_m), visit(e.boresight);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, SampleColumn>
void visit_members(T& c, const Visit& visit) {
  visit(c.sample), visit(c.area_m2), visit(c.share_frac), visit(c.below_w_m2_k),
      visit(c.first_link);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, CellLink>
void visit_members(T& l, const Visit& visit) {
  visit(l.column), visit(l.cell), visit(l.conductance_w_m2_k);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, SeenSample>
void visit_members(T& s, const Visit& visit) {
  visit(s.sample), visit(s.weight_frac);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, SurfaceSample>
void visit_members(T& s, const Visit& visit) {
  visit(s.position_m), visit(s.normal), visit(s.entity), visit(s.body), visit(s.material),
      visit(s.sky_frac), visit(s.sphere_sky_frac), visit(s.hull_open_frac), visit(s.hull_tilt_frac);
  visit(s.rain_frac);
  visit(s.far_frac), visit(s.first_seen), visit(s.seen_count), visit(s.seen_scale);
  visit(s.covered);
  visit(s.foot_m), visit(s.before_frac), visit(s.exposed_frac), visit(s.excess_frac),
      visit(s.felt_frac);
  visit(s.flat_m), visit(s.facet_m);
  visit(s.column);
  visit(s.other_side), visit(s.vertex), visit(s.twin_of);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, SampleState>
void visit_members(T& s, const Visit& visit) {
  visit(s.modes_k), visit(s.cells_k), visit(s.alone_k), visit(s.aside_k);
}
template <class T, class Visit>
requires std::same_as<std::remove_const_t<T>, SampleOutput>
void visit_members(T& o, const Visit& visit) {
  visit(o.offset_k), visit(o.sun_frac), visit(o.longwave_out_w_m2), visit(o.shortwave_out_w_m2);
}

namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// First bytes of a file.
constexpr std::array<char, 8> kMagic{'E', 'M', 'I', 'T', 'S', 'T', 'A', 'T'};
constexpr std::size_t kHeaderBytes = kMagic.size() + 2 * sizeof(std::uint32_t) + sizeof(StateKey) +
                                     sizeof(std::int64_t) + sizeof(std::uint64_t);
constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);

/// Passes the body of a file to a sink. read_state() reads in the same order.
template <class Sink>
void put_model(Sink& sink, const SurfaceModel& model) {
  put_value(sink, model.eyes);
  put_value(sink, static_cast<std::uint64_t>(model.meshes.size()));
  for (const RefinedMesh& mesh : model.meshes) put_value(sink, mesh.parts());
  put_value(sink, model.drawn);
  put_value(sink, model.first_sample);
  put_value(sink, model.samples.samples);
  put_value(sink, model.samples.seen);
  put_value(sink, model.samples.columns);
  put_value(sink, model.samples.links);
  put_value(sink, model.samples.twinned);
  put_value(sink, model.samples.first_twin);
  put_value(sink, model.drawn_samples);
  put_value(sink, model.states);
  put_value(sink, model.outputs);
  put_value(sink, model.body_k);
  put_value(sink, model.exchange_left_w_m2);
  put_value(sink, model.full);
  put_value(sink, model.full_in_view);
}

/// Reads the meshes of a body. Returns false if they are not refinements of the meshes of
/// `geometry`.
bool take_meshes(ByteSource& source, const scene::SceneGeometry& geometry, std::size_t max_vertices,
                 SurfaceModel& model) {
  std::uint64_t meshes = 0;
  take_value(source, meshes);
  if (meshes != geometry.meshes.size()) return false;
  for (const scene::Mesh& mesh : geometry.meshes) {
    RefinedMesh::Parts parts;
    take_value(source, parts);
    if (!source.ok()) return false;
    auto refined = RefinedMesh::from(mesh, max_vertices, std::move(parts));
    if (!refined) return false;
    model.meshes.push_back(std::move(*refined));
  }
  return true;
}

/// Returns true if all triangles and clusters of a drawn mesh exist. `whole` is the mesh that it
/// was cut from.
bool fits(const DrawnMesh& drawn, const scene::Mesh& whole) {
  const ClusterLevels& levels = drawn.levels;
  const std::size_t indices = drawn.indices.size();
  const std::size_t clusters = levels.clusters.size();
  return indices >= whole.indices.size() && indices % 3 == 0 && levels.levels.size() == clusters &&
         levels.of_submesh.size() == whole.submeshes.size() &&
         std::ranges::all_of(drawn.indices,
                             [&](std::uint32_t v) { return v < whole.positions_m.size(); }) &&
         std::ranges::all_of(levels.clusters,
                             [&](const scene::Cluster& cluster) {
                               return cluster.first_index <= indices &&
                                      cluster.index_count <= indices - cluster.first_index &&
                                      cluster.index_count % 3 == 0;
                             }) &&
         std::ranges::all_of(levels.of_submesh, [&](const ClusterLevels::Range& range) {
           return range.first <= clusters && range.count <= clusters - range.first;
         });
}

/// Returns true if the drawn samples, and the twins behind them, stand where they say.
bool twins_fit(const SurfaceModel& model) {
  const SurfaceSamples& all = model.samples;
  const std::size_t twins = all.twinned.size();
  if (all.first_twin != model.drawn_samples ||
      all.samples.size() != model.drawn_samples + 2 * twins) {
    return false;
  }
  for (std::uint32_t s = 0; s < model.drawn_samples; ++s) {
    if (all.samples[s].vertex != s || all.samples[s].twin_of != kNoSample) return false;
  }
  for (std::size_t k = 0; k < 2 * twins; ++k) {
    const SurfaceSample& twin = all.samples[all.first_twin + k];
    const std::uint32_t of = all.twinned[k % twins];
    if (of >= model.drawn_samples || (k % twins > 0 && all.twinned[k % twins - 1] >= of) ||
        twin.twin_of != of || twin.vertex != (1 + k / twins) * model.drawn_samples + of) {
      return false;
    }
  }
  return true;
}

/// Returns true if the arrays of a model fit each other and no index leads out of its array.
bool consistent(const SurfaceModel& model, const scene::SceneGeometry& geometry,
                std::size_t entities) {
  const std::size_t count = model.samples.samples.size();
  const std::size_t seen = model.samples.seen.size();
  const std::vector<SampleColumn>& columns = model.samples.columns;
  if (model.states.size() != count || model.outputs.size() != count ||
      model.drawn_samples > count || model.first_sample.size() != geometry.instances.size() ||
      model.drawn.size() != model.meshes.size()) {
    return false;
  }
  // Check that vertices have materials of the scene, and that each triangle has one material.
  for (std::size_t m = 0; m < geometry.meshes.size(); ++m) {
    const RefinedMesh& mesh = model.meshes[m];
    for (const RefinedMesh::Vertex& vertex : mesh.vertices()) {
      if (vertex.material >= geometry.materials.size()) return false;
    }
    for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
      const std::uint32_t material = geometry.meshes[m].submeshes[mesh.submesh(slot)].material;
      for (const std::uint32_t v : mesh.leaf(slot)) {
        if (mesh.vertices()[v].material != material) return false;
      }
    }
    if (!fits(model.drawn[m], refined_copy(geometry.meshes[m], mesh, geometry.materials))) {
      return false;
    }
  }
  // Check that the samples of each instance belong to one body and that both sides of a sheet
  // belong to the instance.
  const auto& all = model.samples.samples;
  for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
    const scene::Instance& instance = geometry.instances[i];
    const RefinedMesh& mesh = model.meshes[instance.mesh];
    const std::size_t first = model.first_sample[i];
    const std::size_t samples =
        mesh.vertices().size() + back_vertices(mesh, geometry.materials).size();
    if (first + samples > model.drawn_samples) return false;
    for (std::size_t k = first; k < first + samples; ++k) {
      const std::uint32_t other = all[k].other_side;
      if ((all[k].entity >= 0) != (instance.entity_id != 0) || all[k].entity != all[first].entity ||
          (other != kNoSample && (other < first || other >= first + samples))) {
        return false;
      }
    }
  }
  // Check each sample alone: the sides of a sheet name each other, and all other indices lie in
  // their arrays.
  const auto sides_fit = [&](const SurfaceSample& s) {
    return s.other_side == kNoSample ||
           (s.other_side < count && &all[s.other_side] != &s &&
            all[s.other_side].other_side < count && &all[all[s.other_side].other_side] == &s);
  };
  const std::size_t materials =
      geometry.materials.size() + 2 * static_cast<std::size_t>(std::ranges::count_if(
                                          geometry.materials, scene::varies_in_heat));
  const auto sample_fits = [&](const SurfaceSample& s) {
    return sides_fit(s) && s.material < materials && s.entity >= -1 &&
           s.entity < static_cast<std::int64_t>(entities) && s.body >= -1 &&
           s.body < static_cast<std::int64_t>(model.body_k.size()) && s.first_seen <= seen &&
           s.seen_count <= seen - s.first_seen &&
           (s.column == kNoSample ||
            (s.column < columns.size() && columns[s.column].sample < count &&
             &all[columns[s.column].sample] == &s));
  };
  const auto column_fits = [&](const SampleColumn& c) {
    return c.sample < count && std::ranges::is_sorted(c.first_link) &&
           c.first_link.back() <= model.samples.links.size();
  };
  const auto link_fits = [&](const CellLink& l) {
    return l.column < columns.size() && l.cell < physics::kMaxColumnCells &&
           l.conductance_w_m2_k >= 0.0F;
  };
  return std::ranges::all_of(model.samples.samples, sample_fits) && twins_fit(model) &&
         std::ranges::all_of(columns, column_fits) &&
         std::ranges::all_of(model.samples.links, link_fits) &&
         std::ranges::all_of(model.samples.seen,
                             [&](const SeenSample& s) { return s.sample < count; });
}

/// Contents of a file. They are not initialised before they are read: that would touch all of the
/// memory twice.
struct FileBytes {
  std::unique_ptr<std::byte[]> data;
  std::size_t size = 0;
  [[nodiscard]] std::span<const std::byte> all() const { return {data.get(), size}; }
};

/// Reads the first `most` bytes of a file, or all of them if it has fewer. Errors: io.
Result<FileBytes> read_bytes(const std::filesystem::path& file, std::uintmax_t most) {
  const auto unreadable = [&file] {
    return make_error(ErrorCode::io,
                      fmt::format("thermal.state_file {}: cannot be read", file.string()));
  };
  std::error_code error;
  const std::uintmax_t size = std::min(std::filesystem::file_size(file, error), most);
  std::ifstream in(file, std::ios::binary);
  if (error || !in) return unreadable();
  FileBytes bytes{std::make_unique_for_overwrite<std::byte[]>(size), size};
  in.read(reinterpret_cast<char*>(bytes.data.get()), static_cast<std::streamsize>(size));
  if (in.gcount() != static_cast<std::streamsize>(size)) return unreadable();
  return bytes;
}

/// Name of a temporary file in the folder of `file`, different for each process.
std::filesystem::path temporary_beside(const std::filesystem::path& file) {
  std::filesystem::path temporary = file;
  temporary += fmt::format(".{}.tmp", ::getpid());
  return temporary;
}

tl::unexpected<physics::Error> cannot_write(const std::filesystem::path& file,
                                            const std::error_code& error) {
  return make_error(ErrorCode::io, fmt::format("thermal.state_file {}: cannot be written: {}",
                                               file.string(), error.message()));
}

/// The part of a file before the body, member by member.
struct Header {
  std::array<char, 8> magic{};
  std::uint32_t version = 0;
  std::uint32_t parts = 0;
  StateKey key{};
  std::int64_t at_ns = 0;
  std::uint64_t body_bytes = 0;
};

/// Names of the parts whose hashes differ, separated by semicolons.
std::string different_parts(const StateKey& a, const StateKey& b) {
  std::string text;
  for (std::size_t i = 0; i < kStateParts; ++i) {
    if (a[i] == b[i]) continue;
    text += fmt::format("{}{}", text.empty() ? "" : "; ", describe(static_cast<StatePart>(i)));
  }
  return text;
}

/// Reason to refuse a file, as part of an error message; empty if there is none. `bytes` are its
/// first bytes or all of them, and `file_bytes` is its size. Fills `header`. The checksum is tested
/// only if `bytes` holds the whole file.
std::string objection(std::span<const std::byte> bytes, std::uintmax_t file_bytes,
                      const StateWanted& wanted, Header& header) {
  ByteSource source(bytes.first(std::min(bytes.size(), kHeaderBytes)));
  take_value(source, header.magic);
  if (!source.ok() || header.magic != kMagic) return "not a state of the thermal simulation";
  take_value(source, header.version);
  if (source.ok() && header.version != kStateVersion) {
    return fmt::format("version {} of the format, this program reads {}", header.version,
                       kStateVersion);
  }
  take_value(source, header.parts);
  take_value(source, header.key);
  take_value(source, header.at_ns);
  take_value(source, header.body_bytes);
  if (!source.ok() || header.parts != kStateParts || file_bytes < kHeaderBytes + kChecksumBytes ||
      header.body_bytes != file_bytes - kHeaderBytes - kChecksumBytes) {
    return "truncated or damaged";
  }
  if (bytes.size() < file_bytes) return {};
  std::uint64_t stored = 0;
  ByteSource tail(bytes.last(kChecksumBytes));
  take_value(tail, stored);
  if (stored != crc64_xz(bytes.first(bytes.size() - kChecksumBytes)))
    return "damaged: the checksum is wrong";
  // Compare the instants first: the hash of the host's input counts up to there.
  if (header.at_ns < wanted.earliest_ns || header.at_ns > wanted.start_ns) {
    const auto seconds = [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns); };
    return fmt::format(
        "holds the surface at {:.3f} s and serves runs that start up to {:.0f} s later; this run "
        "starts at {:.3f} s",
        seconds(header.at_ns), seconds(wanted.start_ns - wanted.earliest_ns),
        seconds(wanted.start_ns));
  }
  const std::string parts = different_parts(header.key, wanted.key_at(header.at_ns));
  if (!parts.empty()) return "made for another scenario, different in: " + parts;
  return "";
}

}  // namespace

Result<void> write_state(const std::filesystem::path& file, const StateKey& key,
                         const SurfaceModel& model) {
  // Write beside the file and rename, so that no reader sees half a state.
  const std::filesystem::path temporary = temporary_beside(file);
  FileSink sink(temporary);
  // Count the body first, because its size stands before it.
  ByteCount body;
  put_model(body, model);
  put_value(sink, kMagic);
  put_value(sink, kStateVersion);
  put_value(sink, static_cast<std::uint32_t>(kStateParts));
  put_value(sink, key);
  put_value(sink, model.at_ns);
  put_value(sink, static_cast<std::uint64_t>(body.count()));
  put_model(sink, model);
  put_value(sink, sink.checksum());
  std::error_code error = sink.finish();
  if (!error) std::filesystem::rename(temporary, file, error);
  if (!error) return {};
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  return cannot_write(file, error);
}

Result<void> check_state_writable(const std::filesystem::path& file) {
  const std::filesystem::path temporary = temporary_beside(file);
  const std::error_code error = FileSink(temporary).finish();
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  if (error) return cannot_write(file, error);
  return {};
}

Result<SurfaceModel> read_state(const std::filesystem::path& file, const StateWanted& wanted,
                                const scene::SceneGeometry& geometry, std::size_t entities,
                                const SurfaceModelOptions& options) {
  const auto refuse = [&file](const std::string& why) {
    return make_error(ErrorCode::config,
                      fmt::format("thermal.state_file {}: {}. Remove it to have it made anew",
                                  file.string(), why));
  };
  // Check the header first, so that a large file that is no state is not read whole.
  const auto head = read_bytes(file, kHeaderBytes);
  if (!head) return tl::unexpected(head.error());
  std::error_code error;
  Header header;
  std::string why = objection(head->all(), std::filesystem::file_size(file, error), wanted, header);
  if (!why.empty()) return refuse(why);
  // Read the whole file and check again, now with the checksum.
  const auto bytes = read_bytes(file, std::numeric_limits<std::uintmax_t>::max());
  if (!bytes) return tl::unexpected(bytes.error());
  why = objection(bytes->all(), bytes->size, wanted, header);
  if (!why.empty()) return refuse(why);
  // Take the body apart, in the order of put_model().
  const std::span<const std::byte> all = bytes->all();
  ByteSource source(all.subspan(kHeaderBytes, all.size() - kHeaderBytes - kChecksumBytes));
  SurfaceModel model;
  model.at_ns = header.at_ns;
  take_value(source, model.eyes);
  if (!take_meshes(source, geometry, options.max_samples, model)) {
    return refuse("damaged: its meshes are not those of the scene");
  }
  take_value(source, model.drawn);
  take_value(source, model.first_sample);
  take_value(source, model.samples.samples);
  take_value(source, model.samples.seen);
  take_value(source, model.samples.columns);
  take_value(source, model.samples.links);
  take_value(source, model.samples.twinned);
  take_value(source, model.samples.first_twin);
  take_value(source, model.drawn_samples);
  take_value(source, model.states);
  take_value(source, model.outputs);
  take_value(source, model.body_k);
  take_value(source, model.exchange_left_w_m2);
  take_value(source, model.full);
  take_value(source, model.full_in_view);
  // Check all indices: a file with a matching checksum may still be made by a faulty program.
  if (!source.ok() || !source.at_end() || !consistent(model, geometry, entities)) {
    return refuse("damaged: its contents contradict each other");
  }
  return model;
}

}  // namespace emit::renderer
