// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <optional>

namespace emit::server {

/// Wishes of a host for the picture that people look at. No frame follows them.
struct PictureSettings {
  bool on = true;               ///< otherwise the picture is blank
  bool black_hot = false;       ///< otherwise white hot
  bool automatic_gain = false;  ///< limits follow the image, and those below have no meaning
  float low_k = 0.0F;           ///< temperature at the lower end of the colours
  float high_k = 0.0F;          ///< at the upper end
  bool operator==(const PictureSettings&) const = default;
};

/// The settings of the host for whoever displays images. A reader may see the limits of one packet
/// beside the rest of the one before it, until it looks again. The gateway writes, any thread
/// reads. RT-safe.
class PictureBoard {
 public:
  void set(const PictureSettings& settings) noexcept {
    limits_k_.store(std::bit_cast<std::uint64_t>(std::array{settings.low_k, settings.high_k}),
                    std::memory_order_relaxed);
    flags_.store(static_cast<std::uint8_t>(kThere | (settings.on ? kOn : 0U) |
                                           (settings.black_hot ? kBlackHot : 0U) |
                                           (settings.automatic_gain ? kAutomaticGain : 0U)),
                 std::memory_order_release);
  }
  void clear() noexcept { flags_.store(0, std::memory_order_release); }
  /// Returns the newest settings; nothing when no host has any.
  [[nodiscard]] std::optional<PictureSettings> get() const noexcept {
    const unsigned flags = flags_.load(std::memory_order_acquire);
    if ((flags & kThere) == 0) return std::nullopt;
    const auto limits_k =
        std::bit_cast<std::array<float, 2>>(limits_k_.load(std::memory_order_relaxed));
    return PictureSettings{(flags & kOn) != 0, (flags & kBlackHot) != 0,
                           (flags & kAutomaticGain) != 0, limits_k[0], limits_k[1]};
  }

 private:
  static constexpr unsigned kThere = 1;
  static constexpr unsigned kOn = 2;
  static constexpr unsigned kBlackHot = 4;
  static constexpr unsigned kAutomaticGain = 8;

  std::atomic<std::uint8_t> flags_{0};
  std::atomic<std::uint64_t> limits_k_{0};
};

}  // namespace emit::server
