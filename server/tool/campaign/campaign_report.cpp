// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/campaign_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "tool/report/html_page.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/statistics.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

/// A figure that the report shows over conditions.
struct Figure {
  std::string column;
  std::string label;
};

const std::vector<Figure>& figures() {
  static const std::vector<Figure> all{
      {"error_rms_k", "RMS error, K"},
      {"error_p99_k", "error, 99th percentile, K"},
      {"stream_late_frac", "share of late frames"},
      {"stream_delay_p99_ms", "delay from pose to frame, 99th percentile, ms"},
      {"surface_mean_k", "mean surface temperature, K"}};
  return all;
}

Samples samples_of(const std::vector<ResultRow>& rows, const std::string& column) {
  Samples out;
  for (const ResultRow& row : rows) {
    if (const double value = row.number(column); std::isfinite(value)) out.add(value);
  }
  return out;
}

bool varies(const std::vector<ResultRow>& rows, const std::string& column) {
  return std::ranges::any_of(
      rows, [&](const ResultRow& row) { return row.text(column) != rows.front().text(column); });
}

/// Columns over which figures are drawn: numeric keys that vary, the time and the sun.
std::vector<std::string> conditions_of(const CampaignResults& results) {
  std::vector<std::string> out;
  std::vector<std::string> candidates = results.keys;
  candidates.insert(candidates.end(), {"time_s", "sun_elevation_deg", "air_k"});
  for (const std::string& column : candidates) {
    const bool numbers = std::ranges::all_of(
        results.rows, [&](const ResultRow& row) { return std::isfinite(row.number(column)); });
    if (numbers && varies(results.rows, column)) out.push_back(column);
  }
  return out;
}

std::vector<Plot> plots_of(const CampaignResults& results) {
  std::vector<Plot> out;
  for (const Figure& figure : figures()) {
    if (samples_of(results.rows, figure.column).empty()) continue;
    for (const std::string& condition : conditions_of(results)) {
      Plot plot;
      plot.title = figure.label.substr(0, figure.label.find(','));
      plot.x.label = condition;
      plot.y.label = figure.label;
      PlotSeries series;
      for (const ResultRow& row : results.rows) {
        const double y = row.number(figure.column);
        if (!std::isfinite(y)) continue;
        series.points.push_back({row.number(condition), y, "element " + row.text("element")});
      }
      plot.series.push_back(std::move(series));
      out.push_back(std::move(plot));
    }
  }
  return out;
}

std::string table_row(const std::vector<std::string>& cells, const char* tag) {
  std::string out = "<tr>";
  for (const std::string& cell : cells) {
    out += fmt::format("<{0}>{1}</{0}>", tag, html_escaped(cell));
  }
  return out + "</tr>\n";
}

std::string key_figures(const CampaignResults& results) {
  std::string out = "<table>\n" + table_row({"figure", "elements", "median", "p95", "most"}, "th");
  for (const Figure& figure : figures()) {
    const Samples samples = samples_of(results.rows, figure.column);
    if (samples.empty()) continue;
    out += table_row(
        {figure.label, std::to_string(samples.count()), fmt::format("{:.4g}", samples.median()),
         fmt::format("{:.4g}", samples.percentile(0.95)), fmt::format("{:.4g}", samples.max())},
        "td");
  }
  return out + "</table>\n";
}

/// Means of the figures by the values of every key that takes few values.
std::string by_condition(const CampaignResults& results) {
  constexpr std::size_t kFew = 24;
  std::string out;
  std::vector<std::string> keys = results.keys;
  keys.emplace_back("time_s");
  for (const std::string& key : keys) {
    std::map<std::string, std::vector<ResultRow>> groups;
    for (const ResultRow& row : results.rows) groups[row.text(key)].push_back(row);
    if (groups.size() < 2 || groups.size() > kFew) continue;
    std::vector<std::string> header{key, "elements"};
    for (const Figure& figure : figures()) {
      if (!samples_of(results.rows, figure.column).empty()) header.push_back(figure.label);
    }
    out += "<table>\n" + table_row(header, "th");
    std::vector<std::pair<std::string, std::vector<ResultRow>>> sorted(groups.begin(),
                                                                       groups.end());
    std::ranges::stable_sort(sorted, {}, [&](const auto& group) {
      const double value = group.second.front().number(key);
      return std::isfinite(value) ? value : 0.0;
    });
    for (const auto& [value, rows] : sorted) {
      std::vector<std::string> cells{value, std::to_string(rows.size())};
      for (const Figure& figure : figures()) {
        if (samples_of(results.rows, figure.column).empty()) continue;
        const Samples samples = samples_of(rows, figure.column);
        cells.push_back(samples.empty() ? "" : fmt::format("{:.4g}", samples.mean()));
      }
      out += table_row(cells, "td");
    }
    out += "</table>\n<p></p>\n";
  }
  return out;
}

std::string all_elements(const CampaignResults& results) {
  std::vector<std::string> columns;
  for (const ResultRow& row : results.rows) {
    for (const auto& [column, cell] : row.cells()) {
      if (std::ranges::find(columns, column) == columns.end()) columns.push_back(column);
    }
  }
  std::string out = "<div class=\"wide\"><table>\n" + table_row(columns, "th");
  for (const ResultRow& row : results.rows) {
    std::vector<std::string> cells;
    for (const std::string& column : columns) {
      const double value = row.number(column);
      cells.push_back(std::isfinite(value) ? fmt::format("{:.6g}", value) : row.text(column));
    }
    out += table_row(cells, "td");
  }
  return out + "</table></div>\n";
}

}  // namespace

physics::Result<void> write_campaign_table(const std::filesystem::path& file,
                                           const CampaignResults& results) {
  std::vector<ResultRow> rows;
  for (const ResultRow& done : results.rows) {
    rows.push_back(done);
    rows.back().set("status", std::string("done"));
  }
  for (const MissingElement& missing : results.missing) {
    ResultRow row;
    row.set("element", std::to_string(missing.element));
    row.set("status", missing.reason);
    rows.push_back(std::move(row));
  }
  auto out = ReplacingFile::create(file);
  if (!out) return tl::unexpected(std::move(out.error()));
  if (auto done = out->write(result_table(rows)); !done) return done;
  return out->commit();
}

physics::Result<void> write_campaign_html(const std::filesystem::path& file,
                                          const config::CampaignDesc& campaign,
                                          const CampaignResults& results) {
  std::string body = fmt::format("<h1>Campaign {}</h1>\n", html_escaped(campaign.name));
  body += fmt::format("<p>Scenario {}. {} of {} elements are done.</p>\n",
                      html_escaped(campaign.scenario), results.rows.size(),
                      results.rows.size() + results.missing.size());
  if (!results.missing.empty()) {
    body += "<h2>Elements without result</h2>\n<table>\n" + table_row({"element", "reason"}, "th");
    for (const MissingElement& missing : results.missing) {
      body += table_row({std::to_string(missing.element), missing.reason}, "td");
    }
    body += "</table>\n";
  }
  if (!results.rows.empty()) {
    body += "<h2>Key figures</h2>\n" + key_figures(results);
    body += "<h2>Means by condition</h2>\n" + by_condition(results);
    if (const std::vector<Plot> plots = plots_of(results); !plots.empty()) {
      body += "<h2>Figures over conditions</h2>\n" + svg_document(plots);
    }
    body += "<h2>All elements</h2>\n" + all_elements(results);
  }
  constexpr const char* kStyle =
      "th { text-align: left; padding: 3px 18px 3px 0; border-bottom: 2px solid #999; }\n"
      ".wide { overflow-x: auto; font-size: 13px; }\n";
  return write_html(file, html_page("Campaign " + campaign.name, kStyle, body));
}

}  // namespace emit::tool
