// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "campaign_keys.hpp"

namespace emit::config {
namespace {

/// TOML text of a value of a file, as `--set` takes it. Empty, with a message, for what no key has.
std::string value_text(const Node& node, Diagnostics& diagnostics) {
  switch (node.kind) {
    case Node::Kind::boolean:
      return node.boolean ? "true" : "false";
    case Node::Kind::integer:
      return std::to_string(node.integer);
    case Node::Kind::number:
      return toml_number(node.number);
    case Node::Kind::text:
      return toml_string(node.text);
    case Node::Kind::instant:
      return toml_instant(node.instant_ns);
    case Node::Kind::array: {
      std::string out = "[";
      for (const Node& item : node.items) {
        out += (out.size() > 1 ? ", " : "") + value_text(item, diagnostics);
      }
      return out + "]";
    }
    default:
      diagnostics.add(node.at, fmt::format("{} is no value of a key", kind_name(node.kind)));
      return {};
  }
}

bool expect_array(const Node& node, const std::string& name, Diagnostics& diagnostics) {
  if (node.kind == Node::Kind::array) return true;
  diagnostics.add(node.at, fmt::format("'{}' is {}, must be an array", name, kind_name(node.kind)));
  return false;
}

std::vector<std::string> read_texts(const Node& node, const std::string& name,
                                    Diagnostics& diagnostics) {
  std::vector<std::string> out;
  if (!expect_array(node, name, diagnostics)) return out;
  for (const Node& item : node.items) {
    std::string text;
    if (read_text(item, name, text, diagnostics)) out.push_back(std::move(text));
  }
  return out;
}

/// Key of an array of texts. With `assignments` each has to be KEY=VALUE.
template <class T, class Field>
Key<T> texts(std::string name, Field field, bool assignments, std::string meaning) {
  return custom<T>(
      {name, "array of strings", "", assignments ? "KEY=VALUE" : "", std::move(meaning)},
      [name, field, assignments](T& out, const Node& node, Diagnostics& diagnostics) {
        field(out) = read_texts(node, name, diagnostics);
        if (!assignments || node.kind != Node::Kind::array) return;
        for (const Node& item : node.items) {
          if (item.kind == Node::Kind::text && item.text.find('=') == std::string::npos) {
            diagnostics.add(item.at, fmt::format("'{}': '{}' is not KEY=VALUE", name, item.text));
          }
        }
      },
      [field](const T& in) -> std::optional<std::string> {
        std::string out = "[";
        for (const std::string& text : field(in)) {
          out += (out.size() > 1 ? ", " : "") + toml_string(text);
        }
        return out + "]";
      });
}

void read_values(CampaignAxisDraft& out, const Node& node, Diagnostics& diagnostics) {
  if (!expect_array(node, "values", diagnostics)) return;
  out.values_at = node.at;
  out.values = node.items;
}

}  // namespace

const KeyTable<CampaignDesc>& campaign_head_keys() {
  static const KeyTable<CampaignDesc> keys = {
      text<CampaignDesc>("name", EMIT_FIELD(name),
                         "Name of the campaign. Absent: that of the file."),
      required(text<CampaignDesc>("scenario", EMIT_FIELD(scenario),
                                  "Path of the scenario, or the name of a shipped one.")),
      texts<CampaignDesc>("set", EMIT_FIELD(set), true,
                          "Keys of the scenario that all elements have."),
      text<CampaignDesc>("times", EMIT_FIELD(times),
                         "Instants of the elements: a list as of `emit render --times`. Key `time` "
                         "or `time_s` of an axis or sample may take its place."),
      number<CampaignDesc>("utc_offset_h", "h", between(-14.0, 14.0), EMIT_FIELD(utc_offset_h),
                           "Clock of HH:MM minus UTC."),
      integer<CampaignDesc>("samples", "", 0, 100'000, EMIT_FIELD(samples),
                            "Points of the Latin hypercube that the tables `[[sample]]` span."),
      integer<CampaignDesc>("seed", "", 0, 1'000'000'000, EMIT_FIELD(seed),
                            "Seed of the Latin hypercube."),
  };
  return keys;
}

const KeyTable<CampaignAxisDraft>& campaign_axis_keys() {
  static const KeyTable<CampaignAxisDraft> keys = {
      text<CampaignAxisDraft>("key", EMIT_FIELD(key),
                              "Key of the scenario, as `--set` takes it; `time` or `time_s`."),
      texts<CampaignAxisDraft>("keys", EMIT_FIELD(keys), false,
                               "Several keys that change together, in place of `key`."),
      custom<CampaignAxisDraft>(
          {"values", "array", "", "", "Values of the key; with `keys`, an array for each row."},
          read_values, [](const CampaignAxisDraft&) { return std::optional<std::string>(); }),
      number<CampaignAxisDraft>("from", "", any_number(), EMIT_FIELD(from),
                                "First of evenly spaced values, in place of `values`."),
      number<CampaignAxisDraft>("to", "", any_number(), EMIT_FIELD(to), "Last of them."),
      integer<CampaignAxisDraft>("count", "", 0, 100'000, EMIT_FIELD(count),
                                 "Number of them, at least 2."),
  };
  return keys;
}

const KeyTable<CampaignSample>& campaign_sample_keys() {
  static const KeyTable<CampaignSample> keys = {
      required(text<CampaignSample>("key", EMIT_FIELD(key),
                                    "Key of the scenario, as `--set` takes it, or `time_s`.")),
      required(number<CampaignSample>("low", "", any_number(), EMIT_FIELD(low), "Least value.")),
      required(
          number<CampaignSample>("high", "", any_number(), EMIT_FIELD(high), "Greatest value.")),
      boolean<CampaignSample>("logarithmic", EMIT_FIELD(logarithmic),
                              "Values are spread evenly in their logarithm."),
  };
  return keys;
}

const KeyTable<CampaignTruth>& campaign_truth_keys() {
  using Kind = CampaignTruthKind;
  static const KeyTable<CampaignTruth> keys = {
      choice<CampaignTruth>(
          "kind",
          std::vector<std::pair<std::string, Kind>>{
              {"none", Kind::none}, {"solve", Kind::solve}, {"render", Kind::render}},
          EMIT_FIELD(kind),
          "Where the error comes from: the reference solution (`emit solve`), or the same picture "
          "with the keys of `set`."),
      texts<CampaignTruth>("set", EMIT_FIELD(set), true,
                           "Keys of the scenario that only the truth has."),
      choice<CampaignTruth>("dimension",
                            std::vector<std::pair<std::string, std::string>>{
                                {"auto", "auto"}, {"1", "1"}, {"3", "3"}},
                            EMIT_FIELD(dimension), "solve: conduction, as of `emit solve`."),
      integer<CampaignTruth>("rays", "", 1, 1 << 20, EMIT_FIELD(rays),
                             "solve: rays per face or pixel."),
      integer<CampaignTruth>("pixels", "", 0, 1 << 26, EMIT_FIELD(pixels),
                             "solve: surface pixels that are solved; 0: all."),
      number<CampaignTruth>("refine", "", between(0.1, 8.0), EMIT_FIELD(refine),
                            "solve: fineness of three dimensions."),
      number<CampaignTruth>("tolerance_k", "K", above(0.0), EMIT_FIELD(tolerance_k),
                            "solve: error of a step at refine 1."),
      number<CampaignTruth>("spin_up_h", "h", between(0.0, 8784.0), EMIT_FIELD(spin_up_h),
                            "solve: least length of the shaded history before the scenario's."),
  };
  return keys;
}

const KeyTable<CampaignStream>& campaign_stream_keys() {
  static const KeyTable<CampaignStream> keys = {
      integer<CampaignStream>(
          "frames", "", 0, 10'000'000, EMIT_FIELD(frames),
          "Frames of a daemon on loopback, by the scenario's own trajectories; 0: no daemon."),
      number<CampaignStream>("rate_hz", "1/s", between(0.1, 1000.0), EMIT_FIELD(rate_hz),
                             "Poses and frames a second."),
      number<CampaignStream>(
          "budget_ms", "ms", between(0.0, 60'000.0), EMIT_FIELD(budget_ms),
          "A frame is late when it is not ready so long after its pose; 0: one period."),
  };
  return keys;
}

const KeyTable<CampaignRun>& campaign_run_keys() {
  static const KeyTable<CampaignRun> keys = {
      integer<CampaignRun>("jobs", "", 1, 1024, EMIT_FIELD(jobs),
                           "Local runs: elements at a time. Each uses all cores that it gets."),
      integer<CampaignRun>("retries", "", 0, 100, EMIT_FIELD(retries),
                           "Further tries of an element that failed or was killed."),
      number<CampaignRun>("timeout_min", "min", above(0.0), EMIT_FIELD(timeout_min),
                          "An element that takes longer is killed."),
  };
  return keys;
}

const KeyTable<CampaignSlurm>& campaign_slurm_keys() {
  static const KeyTable<CampaignSlurm> keys = {
      text<CampaignSlurm>("partition", EMIT_FIELD(partition),
                          "Partition; empty: the default of the cluster."),
      integer<CampaignSlurm>("cpus", "", 1, 4096, EMIT_FIELD(cpus),
                             "Cores of an element. With `memory_mib` it limits the elements that a "
                             "node runs at a time."),
      integer<CampaignSlurm>("memory_mib", "MiB", 0, 1 << 26, EMIT_FIELD(memory_mib),
                             "Memory of an element; 0: the default of the cluster."),
      integer<CampaignSlurm>("at_once", "", 0, 1'000'000, EMIT_FIELD(at_once),
                             "Elements on the cluster at a time; 0: no limit."),
      texts<CampaignSlurm>("options", EMIT_FIELD(options), false,
                           "Further options of sbatch, such as `--account=infrared`."),
  };
  return keys;
}

const std::vector<SectionDoc>& campaign_sections() {
  static const std::vector<SectionDoc> sections = {
      section_doc("", false, "These keys stand above the first section.", campaign_head_keys(),
                  CampaignDesc{}),
      section_doc("vary", true,
                  "An axis of the grid, which has every combination of the values of its axes. An "
                  "axis with `keys` is a list of conditions.",
                  campaign_axis_keys(), CampaignAxisDraft{}),
      section_doc("sample", true,
                  "A dimension of the Latin hypercube. The grid is repeated for each of its "
                  "`samples` points.",
                  campaign_sample_keys(), CampaignSample{}),
      section_doc("truth", false, "What the picture of an element is compared with.",
                  campaign_truth_keys(), CampaignTruth{}),
      section_doc("stream", false, "Frames of a daemon in each element, for lateness.",
                  campaign_stream_keys(), CampaignStream{}),
      section_doc("run", false, "How elements are run.", campaign_run_keys(), CampaignRun{}),
      section_doc("slurm", false, "Resources of an element with `emit campaign --slurm`.",
                  campaign_slurm_keys(), CampaignSlurm{}),
  };
  return sections;
}

std::vector<std::vector<std::string>> campaign_rows(const CampaignAxisDraft& axis,
                                                    Diagnostics& diagnostics) {
  std::vector<std::vector<std::string>> rows;
  for (const Node& item : axis.values) {
    std::vector<std::string> row;
    if (axis.keys.empty()) {
      row.push_back(value_text(item, diagnostics));
    } else if (expect_array(item, "values", diagnostics)) {
      for (const Node& value : item.items) row.push_back(value_text(value, diagnostics));
      if (row.size() != axis.keys.size()) {
        diagnostics.add(item.at,
                        fmt::format("{} values for {} keys", row.size(), axis.keys.size()));
      }
    }
    rows.push_back(std::move(row));
  }
  for (std::int64_t i = 0; axis.values.empty() && i < axis.count; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(axis.count - 1);
    rows.push_back({toml_number(axis.from + (axis.to - axis.from) * share)});
  }
  return rows;
}

}  // namespace emit::config
