// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <utility>

#include "emit/config/motion_controller.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/axes_memory.hpp"

namespace emit::server {

/// The two blocks of a motion simulator in a mapped file or device (docs/wire.md section 13).
/// Setup only, but for the blocks. Thread: one owner.
class AxesMemory {
 public:
  /// Maps an existing file or device. Errors (io), naming the file: it is missing or not permitted,
  /// a file that ends before the blocks do, or no memory can be mapped.
  [[nodiscard]] static physics::Result<AxesMemory> open(const config::MemoryPlace& place);
  /// Maps the same, and makes the file, zeroed, where there is none.
  [[nodiscard]] static physics::Result<AxesMemory> open_or_make(const config::MemoryPlace& place);

  AxesMemory(AxesMemory&& other) noexcept
      : mapped_(std::exchange(other.mapped_, nullptr)),
        mapped_bytes_(other.mapped_bytes_),
        blocks_(other.blocks_) {}
  AxesMemory& operator=(AxesMemory&& other) noexcept {
    std::swap(mapped_, other.mapped_);
    std::swap(mapped_bytes_, other.mapped_bytes_);
    std::swap(blocks_, other.blocks_);
    return *this;
  }
  ~AxesMemory();

  [[nodiscard]] protocol::AxesCommandBlock command() const noexcept {
    return protocol::AxesCommandBlock(blocks_, protocol::kAxesCommandWords);
  }
  [[nodiscard]] protocol::AxesMonitorBlock monitor() const noexcept {
    return protocol::AxesMonitorBlock(
        blocks_ + protocol::kAxesMonitorAtBytes / sizeof(std::uint64_t),
        protocol::kAxesMonitorWords);
  }

 private:
  AxesMemory(void* mapped, std::size_t mapped_bytes, std::uint64_t* blocks) noexcept
      : mapped_(mapped), mapped_bytes_(mapped_bytes), blocks_(blocks) {}
  [[nodiscard]] static physics::Result<AxesMemory> map(int fd, const config::MemoryPlace& place);

  void* mapped_ = nullptr;
  std::size_t mapped_bytes_ = 0;
  std::uint64_t* blocks_ = nullptr;
};

}  // namespace emit::server
