// SPDX-License-Identifier: Apache-2.0
#include "output/drive_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/physics/csv.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

constexpr std::size_t kMaxPoints = 65536;
constexpr double kMaxParts = 16384.0;

/// Returns the number in a cell. Errors: config, naming the place.
Result<double> number_of(const physics::CsvReader& reader, const physics::CsvCell& cell) {
  const auto value = physics::csv_number(cell.text);
  if (value && std::isfinite(*value)) return *value;
  return make_error(ErrorCode::config, fmt::format("{}: '{}' must be a finite number",
                                                   reader.place_of(cell), cell.text));
}

}  // namespace

Result<DriveTable> DriveTable::read(const std::filesystem::path& file) {
  auto reader = physics::CsvReader::open(file);
  if (!reader) return tl::unexpected(std::move(reader.error()));
  const auto radiance_at = reader->find("radiance_w_m2_sr");
  if (!radiance_at) return tl::unexpected(radiance_at.error());
  const auto drive_at = reader->find("drive");
  if (!drive_at) return tl::unexpected(drive_at.error());
  std::vector<Point> points;
  std::vector<std::uint32_t> lines;
  for (;;) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const auto radiance = number_of(*reader, reader->row()[*radiance_at]);
    if (!radiance) return tl::unexpected(radiance.error());
    const auto drive = number_of(*reader, reader->row()[*drive_at]);
    if (!drive) return tl::unexpected(drive.error());
    points.push_back({*radiance, *drive});
    lines.push_back(reader->line());
  }
  std::size_t at_fault = 0;
  auto table = make(points, at_fault);
  if (!table) {
    const std::string place = at_fault < lines.size()
                                  ? fmt::format("{}:{}", file.string(), lines[at_fault])
                                  : file.string();
    return tl::unexpected(std::move(table.error()).with_context(place));
  }
  return table;
}

Result<DriveTable> DriveTable::make(std::span<const Point> points, std::size_t& at_fault) {
  at_fault = points.size();
  if (points.size() < 2 || points.size() > kMaxPoints) {
    return make_error(ErrorCode::config, fmt::format("a drive table has 2 to {} points, not {}",
                                                     kMaxPoints, points.size()));
  }
  DriveTable out;
  double way = 0.0;  // +1 while drives rise, -1 while they fall, 0 before they have moved
  for (std::size_t i = 0; i < points.size(); ++i) {
    at_fault = i;
    const std::string fault = out.add(points[i], way);
    if (!fault.empty()) {
      return make_error(ErrorCode::config,
                        fmt::format("{} W m-2 sr-1 to {}: {}", points[i].radiance_w_m2_sr,
                                    points[i].drive, fault));
    }
  }
  at_fault = points.size();
  if (!out.divide()) {
    return make_error(
        ErrorCode::config,
        "the radiances of a drive table are too close together, or too far apart, for float32");
  }
  return out;
}

std::string DriveTable::add(const Point& point, double& way) {
  const auto radiance = static_cast<float>(point.radiance_w_m2_sr);
  const auto drive = static_cast<float>(point.drive);
  if (!std::isfinite(radiance) || !std::isfinite(drive)) return "not within the range of float32";
  if (!radiances_.empty()) {
    const float before = radiances_.back();
    if (radiance <= before) {
      return fmt::format("'radiance_w_m2_sr' is not above {} of the row before", before);
    }
    const double step = static_cast<double>(drive) - static_cast<double>(drives_.back());
    if (step * way < 0.0) {
      return fmt::format("'drive' {} after it {}, so that a drive would stand for two radiances",
                         step > 0.0 ? "rises" : "falls", way > 0.0 ? "rose" : "fell");
    }
    if (step != 0.0) way = step > 0.0 ? 1.0 : -1.0;
    slopes_.back() =
        static_cast<float>(step / (static_cast<double>(radiance) - static_cast<double>(before)));
    if (!std::isfinite(slopes_.back())) return "too steep for float32";
  }
  radiances_.push_back(radiance);
  drives_.push_back(drive);
  slopes_.push_back(0.0F);
  return {};
}

bool DriveTable::divide() {
  const double first = radiances_.front();
  const double last = radiances_.back();
  double narrowest = last - first;
  for (std::size_t i = 1; i < radiances_.size(); ++i) {
    narrowest = std::min(
        narrowest, static_cast<double>(radiances_[i]) - static_cast<double>(radiances_[i - 1]));
  }
  // Parts that are half as wide as the narrowest gap hold one point at most.
  const double wanted = std::ceil(2.0 * (last - first) / narrowest);
  last_part_ = static_cast<std::int32_t>(std::min(wanted, kMaxParts));
  parts_per_radiance_ = static_cast<float>(static_cast<double>(last_part_) / (last - first));
  if (!std::isfinite(parts_per_radiance_)) return false;
  // A look-up computes this difference in float32.
  if (!std::isfinite(radiances_.back() - radiances_.front())) return false;
  const auto part_of = [this](float radiance) {
    const float part = (radiance - radiances_.front()) * parts_per_radiance_;
    return std::min(static_cast<std::int32_t>(part), last_part_);
  };
  // A part begins with the last point of an earlier part. part_of() never falls while radiance
  // rises, so the point of a value in the part is this one or one that lies in the part.
  const auto points = static_cast<std::int32_t>(radiances_.size());
  std::int32_t point = 0;
  most_steps_ = 0;
  for (std::int32_t part = 0; part <= last_part_; ++part) {
    const auto radiance_of = [this](std::int32_t i) {
      return radiances_[static_cast<std::size_t>(i)];
    };
    while (point + 1 < points && part_of(radiance_of(point + 1)) < part) ++point;
    parts_.push_back(point);
    std::int32_t end = point;
    while (end + 1 < points && part_of(radiance_of(end + 1)) == part) ++end;
    most_steps_ = std::max(most_steps_, end - point);
  }
  // The point behind the last one is never reached.
  radiances_.push_back(std::numeric_limits<float>::infinity());
  return true;
}

std::uint32_t DriveTable::apply(std::span<float> values) const noexcept {
  const float first = radiances_.front();
  const float last = radiances_[drives_.size() - 1];
  std::uint32_t beyond = 0;
  for (float& value : values) {
    float at = value;
    beyond += at >= first && at <= last ? 0U : 1U;
    at = at > first ? at : first;  // also where it is no number
    at = at < last ? at : last;
    const auto part = static_cast<std::int32_t>((at - first) * parts_per_radiance_);
    auto point =
        static_cast<std::size_t>(parts_[static_cast<std::size_t>(std::min(part, last_part_))]);
    // Every value takes as many steps, because a branch that is mispredicted costs more.
    for (std::int32_t step = 0; step < most_steps_; ++step) {
      point += radiances_[point + 1] <= at ? 1U : 0U;
    }
    value = drives_[point] + (at - radiances_[point]) * slopes_[point];
  }
  return beyond;
}

}  // namespace emit::server
