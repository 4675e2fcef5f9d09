// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

/// The one table of ranges and limits that several modules check: the key table of `config`, the
/// wire formats of `protocol` and the renderer. All bounds are inclusive.
namespace emit::physics::limits {

/// Closed interval of a quantity.
struct Interval {
  double lo = 0.0;
  double hi = 0.0;

  /// False for NaN. Thread: any. RT-safe.
  [[nodiscard]] constexpr bool contains(double value) const noexcept {
    return value >= lo && value <= hi;
  }
};
/// Closed interval of a count.
struct Count {
  std::uint32_t lo = 0;
  std::uint32_t hi = 0;

  /// Thread: any. RT-safe.
  [[nodiscard]] constexpr bool contains(std::uint32_t value) const noexcept {
    return value >= lo && value <= hi;
  }
};

// Weather of scenarios and of host frames.
inline constexpr Interval kDirectNormalWM2{0.0, 2000.0};
inline constexpr Interval kDiffuseHorizontalWM2{0.0, 1500.0};
inline constexpr Interval kLongwaveDownWM2{0.0, 1000.0};
inline constexpr Interval kAirK{180.0, 340.0};
inline constexpr Interval kWindMS{0.0, 100.0};
inline constexpr Interval kCloudFrac{0.0, 1.0};
inline constexpr Interval kEnvironmentK{100.0, 400.0};
inline constexpr Interval kFilmWM2K{0.0, 1000.0};
inline constexpr Interval kWindFromDeg{0.0, 360.0};
inline constexpr Interval kHumidityFrac{0.0, 1.0};
inline constexpr Interval kRainMmH{0.0, 500.0};

// Parts of entities that heat themselves, of scenarios and of host frames.
inline constexpr Interval kPartK{50.0, 3000.0};
inline constexpr Interval kPartPowerWM2{0.0, 1e6};
inline constexpr Interval kPartThrottle{0.0, 1.0};
inline constexpr Count kPartId{1, 65535};

// Poses.
inline constexpr Interval kQuaternionNorm{0.99, 1.01};
/// Largest absolute coordinate of a position, m.
inline constexpr double kMaxPositionM = 1e8;

/// Largest absolute simulation time, seconds from the scenario's epoch: about 31 years.
inline constexpr double kMaxSimTimeS = 1e9;

// Images.
inline constexpr Count kSensorPx{1, 8192};   ///< columns, rows
inline constexpr Count kCannedPx{1, 16384};  ///< columns, rows of the test pattern
inline constexpr Interval kFieldOfViewDeg{0.01, 170.0};
inline constexpr std::uint32_t kMaxBands = 4;  ///< spectral bands that one scenario shows
inline constexpr std::uint32_t kMaxAtmosphereTerms = 4;

// Thermal simulation.
inline constexpr Count kHistorySteps{1, 4096};
inline constexpr Count kShadowMapPx{16, 16384};
inline constexpr Count kCascades{1, 4};
inline constexpr Count kShadowTaps{1, 256};              ///< blocker search and filter, each
inline constexpr std::uint32_t kMaxRelaxationModes = 2;  ///< emit2014: states per surface sample

// Streams.
inline constexpr Count kFragmentPayloadBytes{384, 65472};
inline constexpr Count kRingSlots{3, 1024};
inline constexpr std::uint32_t kMaxFecData = 128;
inline constexpr std::uint32_t kMaxFecParity = 32;
inline constexpr std::uint32_t kMaxEveryNth = 1000;
inline constexpr std::uint32_t kMaxLookAheadFrames = 8;

}  // namespace emit::physics::limits
