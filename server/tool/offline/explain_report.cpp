// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/explain_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tool/offline/time_list.hpp"
#include "tool/report/html_page.hpp"
#include "tool/support/console.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

/// A line of blocks as high as the values are between the least and the largest; blanks for NaN.
std::string sparkline(const std::vector<double>& values, double low, double high) {
  constexpr std::array<std::string_view, 8> kBlocks{"\u2581", "\u2582", "\u2583", "\u2584",
                                                    "\u2585", "\u2586", "\u2587", "\u2588"};
  std::string out;
  for (const double value : values) {
    if (std::isnan(value)) {
      out += ' ';
      continue;
    }
    const double place = high > low ? (value - low) / (high - low) : 0.0;
    out += kBlocks[static_cast<std::size_t>(std::clamp(place, 0.0, 1.0) * 7.0 + 0.5)];
  }
  return out;
}

std::vector<double> values_of(const ProbeRun& history,
                              const std::function<double(const ProbeRow&)>& value) {
  std::vector<double> out;
  for (const ProbeRow& row : history.rows()) out.push_back(value(row));
  return out;
}

std::string history_text(const Explanation& found) {
  const ProbeRun& history = *found.history;
  const auto line = [&](std::string_view name, std::string_view unit,
                        const std::vector<double>& values, bool from_zero) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const double v : values) {
      if (std::isnan(v)) continue;
      low = std::min(low, v);
      high = std::max(high, v);
    }
    if (!(low <= high)) return fmt::format("  {:<12} no values\n", name);
    return fmt::format("  {:<12} {}  {:.6g} .. {:.6g} {}\n", name,
                       sparkline(values, from_zero ? 0.0 : low, high), low, high, unit);
  };
  const double hours = (history.times_s().back() - history.times_s().front()) / 3600.0;
  return fmt::format("history of the surface, last {:.3g} h\n", hours) +
         line("temperature", "K",
              values_of(history, [](const ProbeRow& row) { return row.temperature_k; }), false) +
         line("equilibrium", "K", found.equilibrium_k, false) +
         line("sun", "W/m2", values_of(history, [](const ProbeRow& row) { return row.sun_w_m2; }),
              true) +
         line("flux inwards", "W/m2",
              values_of(history, [](const ProbeRow& row) { return row.flux_w_m2; }), false);
}

/// Cells of a band's table: name, radiance and share of each term, then sum and pixel.
/// True if gas lies before the surface or the sky of a pixel.
bool has_gas(const renderer::RadianceTerms& terms) {
  return terms.gas_frac != 1.0 || terms.gas_w_m2_sr != 0.0;
}

/// True if a pixel shows a glossy surface.
bool has_lobe(const renderer::RadianceTerms& terms) {
  return terms.lobe_sky_w_m2_sr != 0.0 || terms.lobe_neighbours_w_m2_sr != 0.0 ||
         terms.glint_w_m2_sr != 0.0;
}

std::vector<std::vector<std::string>> term_rows(const ExplainedBand& band) {
  std::vector<std::vector<std::string>> out;
  const double sum = band.terms.sum_w_m2_sr();
  for (const auto& [name, value] : named_terms(band.terms)) {
    if (name == "gas" && !has_gas(band.terms)) continue;
    if ((name == "scattered sun" || name == "sun and moon") && value == 0.0) continue;
    const bool of_lobe = name.ends_with("in the lobe") || name == "glint";
    if (of_lobe && !has_lobe(band.terms)) continue;
    out.push_back({std::string(name), fmt::format("{:.6g}", value),
                   fmt::format("{:.2f} %", sum != 0.0 ? 100.0 * value / sum : 0.0)});
  }
  out.push_back({"sum", fmt::format("{:.6g}", sum), ""});
  out.push_back({"pixel of the frame", fmt::format("{:.6g}", band.pixel_w_m2_sr), ""});
  return out;
}

std::string surface_sentence(const Explanation& found) {
  if (!found.surface) {
    if (!found.clouds) return "It shows the sky.";
    return fmt::format("It shows the sky, of which clouds cover {:.1f} % here.",
                       100.0 * found.cloud_frac);
  }
  const ExplainedSurface& s = *found.surface;
  const std::string clutter =
      s.clutter_sd == 0.0
          ? ""
          : fmt::format(
                " Of its temperature {:+.3f} K are clutter: the field of the material is "
                "{:+.2f} standard deviations here.",
                s.clutter_k, s.clutter_sd);
  const std::string clouds =
      found.clouds ? fmt::format(
                         " The clouds let {:.3f} times as much direct sun through here as the "
                         "weather's mean, which is part of that share.",
                         s.cloud_sun)
                   : "";
  return fmt::format(
      "It shows object '{}', material '{}', {:.2f} m away at ({:.3f}, {:.3f}, {:.3f}) m, normal "
      "({:.3f}, {:.3f}, {:.3f}), {:.3f} K. The face sees {:.1f} % sky and takes {:.1f} % of the "
      "direct sun (visible share times cosine).{}{}",
      s.object, s.material, s.range_m, s.position_m.x, s.position_m.y, s.position_m.z, s.normal.x,
      s.normal.y, s.normal.z, s.temperature_k, 100.0 * s.sky_frac, 100.0 * s.sun_cosine, clouds,
      clutter);
}

std::string air_sentence(const Explanation& found, const ExplainedBand& band) {
  const std::string gas =
      has_gas(band.terms) ? fmt::format(" Gas lets {:.4f} through.", band.terms.gas_frac) : "";
  if (!found.surface) return fmt::format("Apparent temperature {:.3f} K.{}", band.apparent_k, gas);
  return fmt::format(
      "Apparent temperature {:.3f} K, emissivity {:.4f}, air lets {:.4f} through (sunlight "
      "{:.4f}).{}",
      band.apparent_k, band.terms.emissivity_frac, band.terms.air_frac, band.terms.air_sun_frac,
      gas);
}

std::string headline(const Explanation& found) {
  return fmt::format("{} at {} (simulation time {:g} s), pixel {},{}", found.scenario,
                     utc_text(found.epoch_utc_ns, found.time_s), found.time_s, found.px.x,
                     found.px.y);
}

}  // namespace

std::array<std::pair<std::string_view, double>, 11> named_terms(
    const renderer::RadianceTerms& terms) {
  return {{{"emission", terms.emission_w_m2_sr},
           {"reflected sky", terms.sky_w_m2_sr},
           {"reflected neighbours", terms.neighbours_w_m2_sr},
           {"reflected sun", terms.sun_w_m2_sr},
           {"sky in the lobe", terms.lobe_sky_w_m2_sr},
           {"neighbours in the lobe", terms.lobe_neighbours_w_m2_sr},
           {"glint", terms.glint_w_m2_sr},
           {"path", terms.path_w_m2_sr},
           {"scattered sun", terms.scattered_w_m2_sr},
           {"sun and moon", terms.bodies_w_m2_sr},
           {"gas", terms.gas_w_m2_sr}}};
}

std::string explain_text(const Explanation& found) {
  std::string out = headline(found) + "\n" + surface_sentence(found) + "\n";
  for (const ExplainedBand& band : found.bands) {
    TextTable table({"band " + band.name, "W m-2 sr-1", "share"});
    for (std::vector<std::string>& row : term_rows(band)) table.add(std::move(row));
    out += "\n" + table.to_string() + air_sentence(found, band) + "\n";
  }
  if (found.history) out += "\n" + history_text(found);
  return out;
}

Json explain_json(const Explanation& found) {
  Json out = Json::object();
  out.set("scenario", found.scenario).set("utc", utc_text(found.epoch_utc_ns, found.time_s));
  out.set("sim_time_s", found.time_s);
  Json px = Json::array();
  px.push(found.px.x).push(found.px.y);
  out.set("px", px);
  const auto vector = [](const glm::dvec3& v) {
    Json json = Json::array();
    json.push(v.x).push(v.y).push(v.z);
    return json;
  };
  if (found.surface) {
    const ExplainedSurface& s = *found.surface;
    Json surface = Json::object();
    surface.set("object", s.object).set("is_entity", s.is_entity);
    surface.set("material", s.material).set("range_m", s.range_m);
    surface.set("position_m", vector(s.position_m)).set("normal", vector(s.normal));
    surface.set("temperature_k", s.temperature_k).set("sky_frac", s.sky_frac);
    surface.set("sun_cosine", s.sun_cosine);
    if (found.clouds) surface.set("cloud_sun", s.cloud_sun);
    surface.set("clutter_sd", s.clutter_sd).set("clutter_k", s.clutter_k);
    out.set("surface", surface);
  } else {
    out.set("surface", nullptr);
    if (found.clouds) out.set("sky_cloud_frac", found.cloud_frac);
  }
  Json bands = Json::array();
  for (const ExplainedBand& band : found.bands) {
    const renderer::RadianceTerms& t = band.terms;
    Json terms = Json::object();
    terms.set("emission_w_m2_sr", t.emission_w_m2_sr).set("sky_w_m2_sr", t.sky_w_m2_sr);
    terms.set("neighbours_w_m2_sr", t.neighbours_w_m2_sr).set("sun_w_m2_sr", t.sun_w_m2_sr);
    terms.set("lobe_sky_w_m2_sr", t.lobe_sky_w_m2_sr);
    terms.set("lobe_neighbours_w_m2_sr", t.lobe_neighbours_w_m2_sr);
    terms.set("glint_w_m2_sr", t.glint_w_m2_sr);
    terms.set("path_w_m2_sr", t.path_w_m2_sr).set("scattered_w_m2_sr", t.scattered_w_m2_sr);
    terms.set("bodies_w_m2_sr", t.bodies_w_m2_sr);
    terms.set("gas_w_m2_sr", t.gas_w_m2_sr);
    Json json = Json::object();
    json.set("band", band.name).set("pixel_w_m2_sr", band.pixel_w_m2_sr);
    json.set("sum_w_m2_sr", t.sum_w_m2_sr()).set("terms", terms);
    json.set("apparent_k", band.apparent_k).set("emissivity_frac", t.emissivity_frac);
    json.set("air_frac", t.air_frac).set("air_sun_frac", t.air_sun_frac);
    json.set("gas_frac", t.gas_frac);
    bands.push(json);
  }
  out.set("bands", bands);
  Json history = Json::array();
  if (found.history) {
    for (std::size_t i = 0; i < found.history->rows().size(); ++i) {
      const ProbeRow& row = found.history->rows()[i];
      Json json = Json::object();
      json.set("sim_time_s", row.time_s).set("temperature_k", row.temperature_k);
      json.set("equilibrium_k", found.equilibrium_k[i]).set("sun_frac", row.sun_frac);
      json.set("sun_w_m2", row.sun_w_m2).set("sky_frac", row.sky_frac);
      json.set("flux_w_m2", row.flux_w_m2);
      history.push(json);
    }
  }
  out.set("history", history);
  return out;
}

std::string explain_page(const Explanation& found) {
  constexpr const char* kStyle =
      "td, th { padding: 3px 18px 3px 0; text-align: right; }\n"
      "td:first-child, th:first-child { text-align: left; }\n"
      "th { border-bottom: 2px solid #999; }\n";
  std::string body = "<h1>" + html_escaped(headline(found)) + "</h1>\n<p>" +
                     html_escaped(surface_sentence(found)) + "</p>\n";
  for (const ExplainedBand& band : found.bands) {
    body += fmt::format(
        "<h2>{}</h2>\n<table>\n<tr><th>term</th><th>W m<sup>-2</sup> sr<sup>-1</sup></th>"
        "<th>share</th></tr>\n",
        html_escaped(band.name));
    for (const std::vector<std::string>& row : term_rows(band)) {
      body += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", row[0], row[1], row[2]);
    }
    body += "</table>\n<p>" + html_escaped(air_sentence(found, band)) + "</p>\n";
  }
  if (found.history) {
    std::vector<Plot> plots = found.history->plots();
    // The histories of radiance are those of a view along the normal, so they are left out.
    plots.resize(plots.size() - found.bands.size());
    PlotSeries equilibrium;
    equilibrium.label = "equilibrium";
    equilibrium.line = true;
    for (std::size_t i = 0; i < found.equilibrium_k.size(); ++i) {
      if (!std::isfinite(found.equilibrium_k[i])) continue;
      equilibrium.points.push_back(
          {found.history->rows()[i].time_s / 3600.0, found.equilibrium_k[i], ""});
    }
    if (!equilibrium.points.empty()) plots.front().series.push_back(std::move(equilibrium));
    body += "<h2>History of the surface</h2>\n" + svg_document(plots);
  }
  return html_page(headline(found), kStyle, body);
}

}  // namespace emit::tool
