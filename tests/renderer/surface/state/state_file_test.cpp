// SPDX-License-Identifier: Apache-2.0
#include "surface/state/state_file.hpp"
#include "surface/state/file_sink.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "renderer/surface/mesh/refined_mesh_support.hpp"
#include "surface/state/state_bytes.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kEntities = 2;
/// The header holds magic, version, number of parts, hashes, instant and size of the body.
constexpr std::size_t kBodyAt = 8 + 4 + 4 + 8 * kStateParts + 8 + 8;
constexpr std::int64_t kAtNs = 7'200'000'000'000;

StateKey some_key() {
  StateKey key{};
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = 0x0123456789abcdefULL * (i + 3);
  return key;
}

/// Number of samples that have a column.
constexpr std::uint32_t kColumns = 3;

/// Sample that has twins.
constexpr std::uint32_t kTwinned = 2;

/// An octahedron of which some leaves are halved, and samples without two equal members.
struct World {
  scene::SceneGeometry geometry;
  SurfaceModel model;
  SurfaceModelOptions options;

  World() {
    geometry.meshes.push_back(octahedron());
    geometry.materials.resize(3);
    geometry.instances.resize(1);
    geometry.instances[0].entity_id = 7;
    model.meshes.emplace_back(geometry.meshes[0], options.max_samples);
    EXPECT_TRUE(model.meshes[0].split(std::vector<std::uint32_t>{0, 3, 5}));
    model.drawn_samples = static_cast<std::uint32_t>(model.meshes[0].vertices().size());
    const std::uint32_t count = model.drawn_samples + 2;
    model.first_sample = {0};
    model.samples.twinned = {kTwinned};
    model.samples.first_twin = model.drawn_samples;
    float next = 0.25F;
    const auto number = [&next] { return next += 0.5F; };
    for (std::uint32_t i = 0; i < count; ++i) {
      SurfaceSample sample;
      sample.position_m = {number(), number(), number()};
      sample.normal = {number(), number(), number()};
      sample.entity = i < model.drawn_samples ? 1 : static_cast<std::int32_t>(i % 3) - 1;
      sample.material = i % 3;
      sample.sky_frac = number();
      sample.sphere_sky_frac = number();
      sample.far_frac = number();
      sample.rain_frac = number();
      sample.hull_open_frac = number();
      sample.hull_tilt_frac = {number(), number(), number()};
      sample.first_seen = i;
      sample.seen_count = 1;
      sample.seen_scale = number();
      sample.covered = i % 2 == 0;
      sample.foot_m = number();
      sample.before_frac = number();
      sample.exposed_frac = number();
      sample.excess_frac = number();
      sample.felt_frac = number();
      sample.flat_m = number();
      sample.vertex = i;
      if (i >= model.drawn_samples) {
        // The samples behind those of the vertices are the twins of one of them.
        sample.twin_of = kTwinned;
        sample.vertex = (1 + i - model.drawn_samples) * model.drawn_samples + kTwinned;
      }
      if (i < kColumns) {
        sample.column = i;
        SampleColumn column;
        column.sample = i;
        column.area_m2 = number();
        column.share_frac[2] = number();
        column.below_w_m2_k[3] = number();
        column.first_link.fill(i);
        column.first_link.back() = i + 1;
        model.samples.columns.push_back(column);
        model.samples.links.push_back({kColumns - 1 - i, i % 8, number()});
      }
      model.samples.samples.push_back(sample);
      model.samples.seen.push_back({count - 1 - i, number()});
      SampleState state;
      state.modes_k[1] = number();
      state.cells_k[1] = number();
      state.alone_k[7] = number();
      state.aside_k = number();
      model.states.push_back(state);
      model.outputs.push_back({number(), number(), number(), number()});
    }
    std::vector<float> value_k(model.drawn_samples);
    for (float& value : value_k) value = number();
    model.drawn =
        drawn_meshes({refined_copy(geometry.meshes[0], model.meshes[0], geometry.materials)},
                     std::vector<VertexValues>{{value_k}});
    model.full = true;
    model.at_ns = kAtNs;
    model.eyes = {{{number(), number(), number()}, {number(), number(), number()}},
                  {{number(), number(), number()}, {number(), number(), number()}}};
  }
};

/// States up to this much older than the start of a run serve it.
constexpr std::int64_t kServedNs = 1'000'000'000;

/// A run that starts at `start_ns` and asks for that key.
StateWanted wanted(const StateKey& key, std::int64_t start_ns = kAtNs) {
  return {[key](std::int64_t) { return key; }, start_ns - kServedNs, start_ns};
}

class StateFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    file_ = folder_ / "x.emitstate";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string bytes() const {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << bytes;
  }
  /// Writes the bytes with a checksum that fits them.
  void put_signed(std::string bytes) const {
    const std::uint64_t value = crc64_xz(std::as_bytes(std::span(bytes)).first(bytes.size() - 8));
    std::memcpy(bytes.data() + bytes.size() - 8, &value, 8);
    put(bytes);
  }
  [[nodiscard]] physics::Result<SurfaceModel> read(const StateKey& key = some_key()) const {
    return read_state(file_, wanted(key), world_.geometry, kEntities, world_.options);
  }
  /// Returns the text of the refusal; empty when the file was accepted.
  [[nodiscard]] std::string refusal(const StateKey& key = some_key()) const {
    const auto got = read(key);
    if (got) return "";
    EXPECT_EQ(got.error().code, physics::ErrorCode::config);
    EXPECT_NE(got.error().text.find(file_.string()), std::string::npos) << got.error().text;
    return got.error().text;
  }
  void write() const { ASSERT_TRUE(write_state(file_, some_key(), world_.model)); }

  World world_;
  std::filesystem::path folder_;
  std::filesystem::path file_;
};

TEST_F(StateFile, gives_back_what_was_written_and_leaves_nothing_beside_it) {
  write();
  const auto files = std::distance(std::filesystem::directory_iterator(folder_), {});
  EXPECT_EQ(files, 1);
  const std::string first = bytes();
  auto got = read();
  ASSERT_TRUE(got) << got.error().text;
  ASSERT_TRUE(write_state(file_, some_key(), *got));
  EXPECT_EQ(bytes(), first);  // every member is in the file

  const SurfaceModel& model = world_.model;
  EXPECT_TRUE(got->full);
  EXPECT_EQ(got->drawn_samples, model.drawn_samples);
  EXPECT_EQ(got->at_ns, kAtNs);
  ASSERT_EQ(got->eyes.size(), model.eyes.size());
  for (std::size_t i = 0; i < model.eyes.size(); ++i) {
    EXPECT_EQ(got->eyes[i].world_m, model.eyes[i].world_m);
    EXPECT_EQ(got->eyes[i].boresight, model.eyes[i].boresight);
  }
  for (std::size_t i = 0; i < model.states.size(); ++i) {
    const SurfaceSample& a = got->samples.samples[i];
    const SurfaceSample& b = model.samples.samples[i];
    EXPECT_EQ(a.position_m, b.position_m);
    EXPECT_EQ(a.normal, b.normal);
    EXPECT_EQ(a.entity, b.entity);
    EXPECT_EQ(a.covered, b.covered);
    EXPECT_EQ(a.foot_m, b.foot_m);
    EXPECT_EQ(a.before_frac, b.before_frac);
    EXPECT_EQ(a.exposed_frac, b.exposed_frac);
    EXPECT_EQ(a.excess_frac, b.excess_frac);
    EXPECT_EQ(a.felt_frac, b.felt_frac);
    EXPECT_EQ(a.material, b.material);
    EXPECT_EQ(a.sky_frac, b.sky_frac);
    EXPECT_EQ(a.sphere_sky_frac, b.sphere_sky_frac);
    EXPECT_EQ(a.far_frac, b.far_frac);
    EXPECT_EQ(a.rain_frac, b.rain_frac);
    EXPECT_EQ(a.hull_open_frac, b.hull_open_frac);
    EXPECT_EQ(a.hull_tilt_frac, b.hull_tilt_frac);
    EXPECT_EQ(a.first_seen, b.first_seen);
    EXPECT_EQ(a.seen_count, b.seen_count);
    EXPECT_EQ(a.seen_scale, b.seen_scale);
    EXPECT_EQ(a.flat_m, b.flat_m);
    EXPECT_EQ(a.column, b.column);
    EXPECT_EQ(a.vertex, b.vertex);
    EXPECT_EQ(a.twin_of, b.twin_of);
    EXPECT_EQ(got->states[i].modes_k, model.states[i].modes_k);
    EXPECT_EQ(got->states[i].cells_k, model.states[i].cells_k);
    EXPECT_EQ(got->states[i].alone_k, model.states[i].alone_k);
    EXPECT_EQ(got->states[i].aside_k, model.states[i].aside_k);
    EXPECT_EQ(got->outputs[i].offset_k, model.outputs[i].offset_k);
    EXPECT_EQ(got->outputs[i].sun_frac, model.outputs[i].sun_frac);
    EXPECT_EQ(got->outputs[i].longwave_out_w_m2, model.outputs[i].longwave_out_w_m2);
    EXPECT_EQ(got->outputs[i].shortwave_out_w_m2, model.outputs[i].shortwave_out_w_m2);
    EXPECT_EQ(got->samples.seen[i].sample, model.samples.seen[i].sample);
    EXPECT_EQ(got->samples.seen[i].weight_frac, model.samples.seen[i].weight_frac);
  }
  ASSERT_EQ(got->samples.columns.size(), kColumns);
  ASSERT_EQ(got->samples.links.size(), kColumns);
  for (std::size_t i = 0; i < kColumns; ++i) {
    EXPECT_EQ(got->samples.columns[i].sample, model.samples.columns[i].sample);
    EXPECT_EQ(got->samples.columns[i].area_m2, model.samples.columns[i].area_m2);
    EXPECT_EQ(got->samples.columns[i].share_frac, model.samples.columns[i].share_frac);
    EXPECT_EQ(got->samples.columns[i].below_w_m2_k, model.samples.columns[i].below_w_m2_k);
    EXPECT_EQ(got->samples.columns[i].first_link, model.samples.columns[i].first_link);
    EXPECT_EQ(got->samples.links[i].column, model.samples.links[i].column);
    EXPECT_EQ(got->samples.links[i].cell, model.samples.links[i].cell);
    EXPECT_EQ(got->samples.links[i].conductance_w_m2_k, model.samples.links[i].conductance_w_m2_k);
  }
  ASSERT_EQ(got->drawn.size(), 1U);
  EXPECT_EQ(got->drawn[0].indices, model.drawn[0].indices);
  EXPECT_EQ(got->drawn[0].levels.clusters.size(), model.drawn[0].levels.clusters.size());
  EXPECT_EQ(got->drawn[0].levels.of_submesh.size(), model.drawn[0].levels.of_submesh.size());
  std::vector<std::uint32_t> indices[2];
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges[2];
  got->meshes[0].write_indices(indices[0], ranges[0]);
  model.meshes[0].write_indices(indices[1], ranges[1]);
  EXPECT_EQ(indices[0], indices[1]);
  EXPECT_EQ(ranges[0], ranges[1]);
}

TEST_F(StateFile, a_mesh_from_a_file_goes_on_being_refined_as_the_one_that_was_kept) {
  write();
  auto got = read();
  ASSERT_TRUE(got);
  const std::vector<std::uint32_t> more{1, 4, 7};
  EXPECT_TRUE(got->meshes[0].split(more));
  EXPECT_TRUE(world_.model.meshes[0].split(more));
  EXPECT_EQ(got->meshes[0].parts().leaves, world_.model.meshes[0].parts().leaves);
  EXPECT_EQ(got->meshes[0].parts().nodes, world_.model.meshes[0].parts().nodes);
}

TEST_F(StateFile, cut_short_anywhere_it_is_refused) {
  write();
  const std::string whole = bytes();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    put(whole.substr(0, size));
    ASSERT_NE(refusal(), "") << size;
  }
  put(whole + "x");
  EXPECT_NE(refusal().find("truncated or damaged"), std::string::npos);
}

TEST_F(StateFile, with_any_byte_changed_it_is_refused) {
  write();
  const std::string whole = bytes();
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string changed = whole;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    put(changed);
    ASSERT_NE(refusal(), "") << i;
  }
}

TEST_F(StateFile, made_for_something_else_it_says_what_differs) {
  write();
  for (std::size_t i = 0; i < kStateParts; ++i) {
    StateKey other = some_key();
    ++other[i];
    const std::string text = refusal(other);
    for (std::size_t j = 0; j < kStateParts; ++j) {
      EXPECT_EQ(text.find(describe(static_cast<StatePart>(j))) != std::string::npos, i == j)
          << text;
    }
  }
}

TEST_F(StateFile, serves_a_run_that_starts_a_little_later) {
  write();
  std::vector<std::int64_t> asked_ns;
  for (const std::int64_t later_ns : {std::int64_t{0}, std::int64_t{1}, kServedNs}) {
    StateWanted want = wanted(some_key(), kAtNs + later_ns);
    want.key_at = [&asked_ns](std::int64_t at_ns) {
      asked_ns.push_back(at_ns);
      return some_key();
    };
    const auto got = read_state(file_, want, world_.geometry, kEntities, world_.options);
    ASSERT_TRUE(got) << got.error().text;
    EXPECT_EQ(got->at_ns, kAtNs);
  }
  // The host's input counts up to the instant of the state, not to the start of the run.
  ASSERT_FALSE(asked_ns.empty());
  for (const std::int64_t at_ns : asked_ns) EXPECT_EQ(at_ns, kAtNs);
}

TEST_F(StateFile, of_an_instant_that_will_not_do_it_says_so) {
  write();
  const auto read_at = [this](std::int64_t start_ns) {
    return read_state(file_, wanted(some_key(), start_ns), world_.geometry, kEntities,
                      world_.options);
  };
  EXPECT_TRUE(read_at(kAtNs));
  for (const std::int64_t apart_ns : {std::int64_t{-1}, kServedNs + 1}) {
    const auto refused = read_at(kAtNs + apart_ns);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, physics::ErrorCode::config);
    EXPECT_NE(
        refused.error().text.find("surface at 7200.000 s and serves runs that start up to 1 s"),
        std::string::npos)
        << refused.error().text;
  }
}

TEST_F(StateFile, of_another_kind_or_version_it_says_so) {
  write();
  std::string other = bytes();
  other[8] = 99;
  put_signed(other);
  EXPECT_NE(refusal().find("version 99"), std::string::npos);
  put("[thermal]\nsteps = 27\n");
  EXPECT_NE(refusal().find("not a state"), std::string::npos);
}

TEST_F(StateFile, huge_counts_and_indices_out_of_range_are_refused_though_the_checksum_holds) {
  write();
  const std::string whole = bytes();
  // The test reads any eight bytes of the body as a count or as indices of 2^60 and more. A file
  // that is accepted must have no index that leads anywhere else. Reading all of them shows it.
  std::size_t refused = 0;
  for (std::size_t at = kBodyAt; at + 16 <= whole.size(); at += 4) {
    std::string changed = whole;
    std::memset(changed.data() + at, 0x7f, 8);
    put_signed(changed);
    const auto got = read();
    if (!got) {
      ++refused;
      continue;
    }
    const std::size_t count = got->samples.samples.size();
    for (const SurfaceSample& sample : got->samples.samples) {
      ASSERT_LE(sample.first_seen + sample.seen_count, got->samples.seen.size());
      ASSERT_LT(sample.entity, static_cast<std::int32_t>(kEntities));
      ASSERT_TRUE(sample.column == kNoSample || sample.column < got->samples.columns.size());
    }
    for (const SampleColumn& column : got->samples.columns) {
      ASSERT_LT(column.sample, count);
      ASSERT_LE(column.first_link.back(), got->samples.links.size());
    }
    for (const CellLink& link : got->samples.links) {
      ASSERT_LT(link.column, got->samples.columns.size());
      ASSERT_LT(link.cell, physics::kMaxColumnCells);
    }
    for (const SeenSample& seen : got->samples.seen) ASSERT_LT(seen.sample, count);
    for (const std::uint32_t v : got->drawn[0].indices) ASSERT_LT(v, got->drawn_samples);
    for (const scene::Cluster& cluster : got->drawn[0].levels.clusters) {
      ASSERT_LE(std::size_t{cluster.first_index} + cluster.index_count,
                got->drawn[0].indices.size());
    }
  }
  EXPECT_GT(refused, 200U);
}

TEST_F(StateFile, drawn_meshes_that_do_not_fit_their_meshes_are_refused) {
  const auto refused = [this](auto&& change) {
    const std::vector<DrawnMesh> whole = world_.model.drawn;
    change(world_.model.drawn);
    write();
    world_.model.drawn = whole;
    return !read();
  };
  using Drawn = std::vector<DrawnMesh>;
  EXPECT_FALSE(refused([](Drawn&) {}));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn.clear(); }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn.push_back(drawn[0]); }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].indices.resize(3); }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].indices.push_back(0); }));
  EXPECT_TRUE(refused([this](Drawn& drawn) {
    drawn[0].indices[0] = static_cast<std::uint32_t>(world_.model.meshes[0].vertices().size());
  }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].levels.levels.pop_back(); }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].levels.of_submesh.pop_back(); }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].levels.of_submesh[0].count += 99; }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].levels.clusters[0].index_count += 999; }));
  EXPECT_TRUE(refused([](Drawn& drawn) { drawn[0].levels.clusters[0].first_index = ~0U; }));
}

TEST(FileSink, WritesBlocksAsOneFileWithOneChecksum) {
  // Three blocks and a part of one, in pieces that do not fit a block.
  std::vector<std::byte> bytes(3'300'007);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>((i * 2'654'435'761U) >> 13U);
  }
  const auto file = std::filesystem::path(::testing::TempDir()) / "file_sink.bin";
  FileSink sink(file);
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t piece = std::min<std::size_t>(bytes.size() - at, at == 0 ? 2'500'001 : 4'099);
    sink.put(bytes.data() + at, piece);
    at += piece;
  }
  EXPECT_EQ(sink.checksum(), crc64_xz(bytes));
  EXPECT_FALSE(sink.finish());
  std::ifstream in(file, std::ios::binary);
  const std::string read((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(read)), bytes));
  std::filesystem::remove(file);
}

TEST(FileSink, SaysThatADiskIsFull) {
  FileSink sink("/dev/full");
  sink.put("12345", 5);
  EXPECT_EQ(sink.finish(), std::errc::no_space_on_device);
}

TEST(StateChecksum, IsTheCatalogued) {
  // The check value of CRC-64/XZ: its sum over the digits 1 to 9.
  constexpr std::string_view kDigits = "123456789";
  EXPECT_EQ(crc64_xz(std::as_bytes(std::span(kDigits))), 0x995dc9bbdf1939faULL);
}

TEST_F(StateFile, samples_that_belong_to_something_else_are_refused) {
  auto& samples = world_.model.samples.samples;
  const auto refused = [this] {
    write();
    return !read();
  };
  samples[0].entity = -1;  // of an entity's instance
  EXPECT_TRUE(refused());
  samples[0].entity = samples[1].entity;
  EXPECT_FALSE(refused());
  samples[0].other_side = 3;  // which knows nothing of it
  EXPECT_TRUE(refused());
  samples[3].other_side = 0;
  EXPECT_FALSE(refused());
  const auto last = static_cast<std::uint32_t>(samples.size() - 1);  // not of the instance
  samples[3].other_side = kNoSample;
  samples[0].other_side = last;
  samples[last].other_side = 0;
  EXPECT_TRUE(refused());
}

TEST_F(StateFile, twins_that_stand_elsewhere_are_refused) {
  SurfaceSamples& all = world_.model.samples;
  const auto refused_with = [&](auto& value, std::uint32_t wrong) {
    const auto right = std::exchange(value, wrong);
    write();
    const bool refused = !read();
    value = right;
    write();
    EXPECT_TRUE(read());
    return refused;
  };
  EXPECT_TRUE(refused_with(all.samples[0].vertex, 1));
  EXPECT_TRUE(refused_with(all.samples[0].twin_of, 1));
  EXPECT_TRUE(refused_with(all.samples.back().vertex, kTwinned));
  EXPECT_TRUE(refused_with(all.samples.back().twin_of, 0));
  EXPECT_TRUE(refused_with(all.twinned[0], world_.model.drawn_samples));
  EXPECT_TRUE(refused_with(all.first_twin, 0));
}

TEST_F(StateFile, that_is_not_there_or_cannot_be_written_is_an_error_of_the_disk) {
  const auto missing = read();
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, physics::ErrorCode::io);
  const auto nowhere = folder_ / "no-such-folder" / "x.emitstate";
  for (const auto& got :
       {write_state(nowhere, some_key(), world_.model), check_state_writable(nowhere)}) {
    ASSERT_FALSE(got);
    EXPECT_EQ(got.error().code, physics::ErrorCode::io);
    EXPECT_NE(got.error().text.find(nowhere.string()), std::string::npos);
  }
  EXPECT_TRUE(check_state_writable(file_));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST(RefinedMesh, parts_that_contradict_each_other_make_no_mesh) {
  const scene::Mesh source = octahedron();
  RefinedMesh mesh(source, kNoLimit);
  ASSERT_TRUE(mesh.split(std::vector<std::uint32_t>{0, 3, 5}));
  const auto broken = [&](auto&& change) {
    RefinedMesh::Parts parts = mesh.parts();
    change(parts);
    return !RefinedMesh::from(source, kNoLimit, std::move(parts)).has_value();
  };
  using Parts = RefinedMesh::Parts;
  EXPECT_FALSE(broken([](Parts&) {}));
  EXPECT_TRUE(broken([](Parts& p) { p.leaves[2][1] = 1000; }));
  EXPECT_TRUE(broken([](Parts& p) { p.leaf_submesh[1] = 2; }));
  EXPECT_TRUE(broken([](Parts& p) { p.vertices[3].parent[0] = 4; }));
  EXPECT_TRUE(broken([](Parts& p) { p.vertices[3].position_m.x += 1.0F; }));
  EXPECT_TRUE(broken([](Parts& p) { p.leaf_node[0] = 1; }));
  EXPECT_TRUE(broken([](Parts& p) { p.nodes.pop_back(); }));
  EXPECT_TRUE(broken([](Parts& p) { p.nodes[0] = 0; }));           // its own child
  EXPECT_TRUE(broken([](Parts& p) { p.nodes[3] = p.nodes[0]; }));  // two parents
  EXPECT_TRUE(broken([](Parts& p) { p.leaves.pop_back(); }));
}

}  // namespace
}  // namespace emit::renderer
