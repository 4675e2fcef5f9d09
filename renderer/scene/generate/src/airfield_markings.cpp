// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "airfield.hpp"
#include "emit/physics/constants.hpp"
#include "random.hpp"

/// Paint and rubber on the airfield. The markings are those of a runway of code number 3 or 4 (ICAO
/// Annex 14, chapter 5), moved together where the short runway asks for it.
namespace emit::scenegen {
namespace {

constexpr const char* kWhite = "runway_paint";
constexpr const char* kYellow = "paint_yellow";
constexpr const char* kRubber = "asphalt_rubber";
constexpr double kMiddleY = -250.0;  ///< of the runway
constexpr double kEndX = 470.0;      ///< threshold, to both sides

/// Adds a rectangle with corners in any order.
void add_box(GroundPlan& plan, const glm::dvec2& a, const glm::dvec2& b, const char* material) {
  plan.rectangle(std::min(a.x, b.x), std::min(a.y, b.y), std::max(a.x, b.x), std::max(a.y, b.y),
                 material);
}

/// Adds a digit of straight strokes, 9 m high and 3 m wide, for a pilot who flies towards +x with
/// `flight` = 1, or towards -x with -1. Its lower left corner is at `foot`.
void add_digit(GroundPlan& plan, char digit, const glm::dvec2& foot, double flight) {
  constexpr double kWidth = 3.0;
  constexpr double kHeight = 9.0;
  constexpr double kStroke = 0.9;
  const auto bar = [&](double right0, double up0, double right1, double up1) {
    const auto place = [&](double right, double up) {
      return foot + flight * glm::dvec2(up, -right);
    };
    add_box(plan, place(right0, up0), place(right1, up1), kWhite);
  };
  // Segments: top, upper right, lower right, bottom, lower left, upper left, middle.
  struct Shape {
    char digit;
    std::array<bool, 7> on;
  };
  constexpr std::array<Shape, 4> kShapes = {{{'0', {true, true, true, true, true, true, false}},
                                             {'2', {true, true, false, true, true, false, true}},
                                             {'7', {true, true, true, false, false, false, false}},
                                             {'9', {true, true, true, true, false, true, true}}}};
  const auto* const shape = std::ranges::find(kShapes, digit, &Shape::digit);
  const double half = 0.5 * kHeight;
  const double mid = 0.5 * kStroke;
  if (shape->on[0]) bar(0.0, kHeight - kStroke, kWidth, kHeight);
  if (shape->on[1]) bar(kWidth - kStroke, half - mid, kWidth, kHeight);
  if (shape->on[2]) bar(kWidth - kStroke, 0.0, kWidth, half + mid);
  if (shape->on[3]) bar(0.0, 0.0, kWidth, kStroke);
  if (shape->on[4]) bar(0.0, 0.0, kStroke, half + mid);
  if (shape->on[5]) bar(0.0, half - mid, kStroke, kHeight);
  if (shape->on[6]) bar(0.0, half - mid, kWidth, half + mid);
}

/// Adds the markings of one end of the runway. `flight` is 1 where aircraft land towards +x.
void add_runway_end(GroundPlan& plan, double flight, std::string_view name) {
  // A bar lies `from` to `to` behind the threshold and `left` to `right` of the centre line.
  const auto bar = [&](double from, double to, double right0, double right1) {
    const auto place = [&](double behind, double right) {
      return glm::dvec2(flight * (behind - kEndX), kMiddleY - flight * right);
    };
    add_box(plan, place(from, right0), place(to, right1), kWhite);
  };
  for (const double side : {-1.0, 1.0}) {
    for (int stripe = 0; stripe < 5; ++stripe) {
      const double right = side * (2.7 + 3.6 * stripe);
      bar(6.0, 36.0, right, right + side * 1.8);
    }
    bar(300.0, 345.0, side * 9.0, side * 15.0);                             // aiming point
    for (const auto& [behind, bars] : {std::pair{150.0, 3}, {225.0, 2}}) {  // touch-down zone
      for (int i = 0; i < bars; ++i) {
        const double right = side * (9.0 + 3.3 * i);
        bar(behind, behind + 22.5, right, right + side * 1.8);
      }
    }
  }
  const double behind = 48.0;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const double right = i == 0 ? -4.0 : 1.0;
    add_digit(plan, name[i], {flight * (behind - kEndX), kMiddleY - flight * right}, flight);
  }
}

void add_runway_markings(GroundPlan& plan) {
  for (double x = -380.0; x < 360.0; x += 50.0) {  // centre line, 30 m on, 20 m off
    plan.rectangle(x, kMiddleY - 0.45, x + 30.0, kMiddleY + 0.45, kWhite);
  }
  for (const double y : {kMiddleY - 22.0, kMiddleY + 21.1}) {  // side stripes
    for (double x = -480.0; x < 480.0; x += 60.0) plan.rectangle(x, y, x + 60.0, y + 0.9, kWhite);
  }
  add_runway_end(plan, 1.0, "09");
  add_runway_end(plan, -1.0, "27");
}

/// Points of a quarter circle from a line along x at height `y` to a line along y at `x`. The
/// circle opens towards `east` and `north`, each 1 or -1.
std::vector<glm::dvec2> turn_points(double x, double y, double east, double north,
                                    double radius_m) {
  constexpr int kSteps = 8;
  std::vector<glm::dvec2> points;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 0.5 * physics::kPi * i / kSteps;
    points.emplace_back(x + east * radius_m * (1.0 - std::sin(angle)),
                        y + north * radius_m * (1.0 - std::cos(angle)));
  }
  return points;
}

void add_taxi_lines(GroundPlan& plan) {
  constexpr double kHalfM = 0.2;
  constexpr double kTaxiY = -100.0;
  constexpr double kTurnM = 28.0;
  for (const double x : {-400.0, 0.0, 400.0}) {
    for (const double side : {-1.0, 1.0}) {
      if (side * x < 399.0) plan.band(turn_points(x, kTaxiY, side, -1.0, kTurnM), 0.4, kYellow);
    }
    plan.rectangle(x - kHalfM, kMiddleY + 24.0, x + kHalfM, kTaxiY, kYellow);
    // Four lines across say where to hold: two whole ones towards the taxiway, two broken ones.
    for (const double y : {-178.0, -178.6}) {
      plan.rectangle(x - 11.5, y, x - kHalfM, y + 0.3, kYellow);
      plan.rectangle(x + kHalfM, y, x + 11.5, y + 0.3, kYellow);
    }
    for (const double y : {-179.2, -179.8}) {
      for (double dash = -11.5; dash < 11.0; dash += 1.8) {
        if (std::abs(dash + 0.45) < 0.8) continue;
        plan.rectangle(x + dash, y, x + dash + 0.9, y + 0.3, kYellow);
      }
    }
  }
  for (const double x : {-100.0, 100.0}) {
    for (const double side : {-1.0, 1.0}) {
      plan.band(turn_points(x, kTaxiY, side, 1.0, kTurnM), 0.4, kYellow);
    }
    plan.rectangle(x - kHalfM, kTaxiY, x + kHalfM, 40.0, kYellow);
  }
  for (double x = -480.0; x < 480.0; x += 40.0) {
    plan.rectangle(x, kTaxiY - kHalfM, x + 40.0, kTaxiY + kHalfM, kYellow);
  }
}

void add_stands(GroundPlan& plan) {
  for (double x = -220.0; x < 220.0; x += 40.0) {  // edge of the manoeuvring area
    plan.rectangle(x, 40.0, x + 40.0, 40.3, kYellow);
  }
  for (const double x : {-180.0, -140.0, -60.0, 60.0, 140.0, 180.0}) {  // lead-in lines
    plan.rectangle(x - 0.15, 40.0, x + 0.15, 110.0, kYellow);
    plan.rectangle(x - 3.0, 109.7, x + 3.0, 110.0, kYellow);
    for (const double side : {-20.5, 20.5}) {  // limits of the stand
      if (std::abs(x) < 170.0) plan.rectangle(x + side - 0.1, 60.0, x + side + 0.1, 124.0, kWhite);
    }
  }
}

/// Adds the marks of tyres that spun up at touch-down. They lie in lanes, so that none is a sliver
/// beside another.
void add_touch_down(GroundPlan& plan, Random& random, double flight) {
  constexpr double kLaneM = 0.45;
  constexpr int kMarks = 74;
  for (int mark = 0; mark < kMarks; ++mark) {
    // Three numbers added up are nearly normal: most land close to the aiming point.
    const double behind = 300.0 + random.between(-75.0, 75.0) + random.between(-75.0, 75.0) +
                          random.between(-40.0, 40.0);
    const double length = std::round(random.between(14.0, 46.0));
    const double right = 3.6 + random.between(-1.3, 1.3) + random.between(-1.3, 1.3);
    for (const double side : {-1.0, 1.0}) {
      const double lane = kLaneM * std::round((side * right + random.between(-0.4, 0.4)) / kLaneM);
      const double y = kMiddleY + lane;
      const double from = flight * (std::round(behind) - kEndX);
      add_box(plan, {from, y}, {from + flight * length, y + kLaneM}, kRubber);
    }
  }
}

}  // namespace

void add_tyre_marks(GroundPlan& plan, std::uint32_t seed) {
  Random random(seed + 1);
  for (const double flight : {1.0, -1.0}) add_touch_down(plan, random, flight);
  // Tyres have darkened two lanes of the taxi route to the apron, and its bends.
  for (const double lane : {-2.4, 2.4}) {
    for (double x = -100.0; x < 100.0; x += 40.0) {
      plan.rectangle(x, -100.0 + lane - 0.35, x + 40.0, -100.0 + lane + 0.35, kRubber);
    }
    for (const double x : {-100.0, 100.0}) {
      plan.rectangle(x + lane - 0.35, -72.0, x + lane + 0.35, 38.0, kRubber);
      const double side = x < 0.0 ? 1.0 : -1.0;
      plan.band(turn_points(x + side * lane, -100.0 + lane, side, 1.0, 28.0), 0.7, kRubber);
    }
    for (const double y : {-226.0, -190.0, -154.0}) {
      plan.rectangle(lane - 0.35, y, lane + 0.35, y + 36.0, kRubber);
    }
  }
  // Aircraft that turn off their lead-in lines leave short marks.
  for (const double x : {-140.0, -60.0, 60.0, 140.0}) {
    for (const double lane : {-2.4, 2.4}) {
      plan.rectangle(x + lane - 0.25, 44.0, x + lane + 0.25, 60.0, kRubber);
    }
  }
}

void add_markings(GroundPlan& plan) {
  add_runway_markings(plan);
  add_taxi_lines(plan);
  add_stands(plan);
}

}  // namespace emit::scenegen
