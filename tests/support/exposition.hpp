// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <charconv>
#include <cmath>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

/// Checker of Prometheus' text format 0.0.4, as strict as Prometheus' own, and stricter where this
/// project promises more. It shares no code with the writer or with `emit stat`.
namespace emit::test {

class Exposition {
 public:
  using Labels = std::map<std::string, std::string>;
  struct Sample {
    std::string name;
    Labels labels;
    double value = 0.0;
  };

  explicit Exposition(const std::string& text) { read(text); }

  /// Returns the first fault; empty: the text is sound.
  [[nodiscard]] const std::string& fault() const { return fault_; }
  [[nodiscard]] const std::vector<Sample>& samples() const { return samples_; }
  /// Returns a value; NaN: there is none with that name and all of these labels.
  [[nodiscard]] double value(const std::string& name, const Labels& labels = {}) const {
    for (const Sample& sample : samples_) {
      bool fits = sample.name == name;
      for (const auto& [label, content] : labels) {
        const auto found = sample.labels.find(label);
        fits = fits && found != sample.labels.end() && found->second == content;
      }
      if (fits) return sample.value;
    }
    return std::nan("");
  }

 private:
  void fail(const std::string& why, const std::string& line) {
    if (fault_.empty()) fault_ = why + ": " + line;
  }

  void read(const std::string& text) {
    if (text.empty() || text.back() != '\n') fail("no line end at the end", "");
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("# HELP ")) {
        take_help(line);
      } else if (line.starts_with("# TYPE ")) {
        take_type(line);
      } else {
        take_sample(line);
      }
    }
    end_family();
  }

  void take_help(const std::string& line) {
    end_family();
    static const std::regex kHelp("# HELP ([a-zA-Z_:][a-zA-Z0-9_:]*) (.+)");
    std::smatch match;
    if (!std::regex_match(line, match, kHelp)) return fail("malformed help", line);
    family_ = match[1];
    type_.clear();
    if (!families_.insert(family_).second) fail("a family twice", line);
    if (!family_.starts_with("emitd_")) fail("a foreign name", line);
  }

  void take_type(const std::string& line) {
    static const std::regex kType("# TYPE ([a-zA-Z_:][a-zA-Z0-9_:]*) (counter|gauge|histogram)");
    std::smatch match;
    if (!std::regex_match(line, match, kType)) return fail("malformed type", line);
    if (match[1] != family_ || !type_.empty()) fail("a type without its help before it", line);
    type_ = match[2];
    if ((type_ == "counter") != family_.ends_with("_total")) fail("counters end in _total", line);
  }

  void take_sample(const std::string& line) {
    static const std::regex kSample(
        "([a-zA-Z_:][a-zA-Z0-9_:]*)(\\{(.*)\\})? ([+-]?Inf|NaN|[-+0-9.eE]+)");
    std::smatch match;
    if (!std::regex_match(line, match, kSample)) return fail("malformed sample", line);
    Sample sample{match[1], parse_labels(match[3], line), 0.0};
    const std::string number = match[4];
    if (number == "+Inf") {
      sample.value = HUGE_VAL;
    } else {
      const auto [end, code] =
          std::from_chars(number.data(), number.data() + number.size(), sample.value);
      if (code != std::errc() || end != number.data() + number.size()) fail("no number", line);
    }
    const bool belongs = type_ == "histogram" ? sample.name == family_ + "_bucket" ||
                                                    sample.name == family_ + "_sum" ||
                                                    sample.name == family_ + "_count"
                                              : sample.name == family_;
    if (type_.empty() || !belongs) fail("outside its family", line);
    if (type_ != "gauge" && !(sample.value >= 0.0)) fail("a negative count", line);
    if (!seen_.insert({sample.name, sample.labels}).second) fail("a sample twice", line);
    samples_.push_back(sample);
    if (type_ == "histogram") of_family_.push_back(sample);
  }

  Labels parse_labels(const std::string& text, const std::string& line) {
    static const std::regex kLabel(
        "([a-zA-Z_][a-zA-Z0-9_]*)=\"((?:[^\"\\\\\\n]|\\\\\\\\|\\\\\"|\\\\n)*)\"(,|$)");
    Labels labels;
    auto at = text.cbegin();
    std::smatch match;
    while (at != text.cend()) {
      if (!std::regex_search(at, text.cend(), match, kLabel,
                             std::regex_constants::match_continuous)) {
        fail("malformed labels", line);
        break;
      }
      if (!labels.emplace(match[1], match[2]).second) fail("a label twice", line);
      at = match[0].second;
    }
    for (const char c : text) {
      if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7E) {
        fail("not printable", line);
      }
    }
    return labels;
  }

  /// Checks histograms: buckets ascend and end in +Inf, which is the count; there is a sum.
  void end_family() {
    struct Series {
      std::vector<std::pair<double, double>> buckets;
      double count = -1.0;
      double sum = -1.0;
    };
    std::map<Labels, Series> all;
    for (const Sample& sample : of_family_) {
      Labels labels = sample.labels;
      const std::string bound = labels["le"];
      labels.erase("le");
      Series& series = all[labels];
      if (sample.name == family_ + "_count") series.count = sample.value;
      if (sample.name == family_ + "_sum") series.sum = sample.value;
      if (sample.name == family_ + "_bucket") {
        series.buckets.emplace_back(
            bound == "+Inf" ? HUGE_VAL : std::strtod(bound.c_str(), nullptr), sample.value);
      }
    }
    for (const auto& [labels, series] : all) {
      const auto& buckets = series.buckets;
      for (std::size_t i = 1; i < buckets.size(); ++i) {
        if (!(buckets[i].first > buckets[i - 1].first) ||
            !(buckets[i].second >= buckets[i - 1].second)) {
          fail("buckets do not ascend", family_);
        }
      }
      if (buckets.empty() || !std::isinf(buckets.back().first) ||
          buckets.back().second != series.count || series.sum < 0.0) {
        fail("an incomplete histogram", family_);
      }
    }
    of_family_.clear();
  }

  std::string fault_;
  std::vector<Sample> samples_;
  std::set<std::string> families_;
  std::set<std::pair<std::string, Labels>> seen_;
  std::string family_;
  std::string type_;
  std::vector<Sample> of_family_;
};

}  // namespace emit::test
