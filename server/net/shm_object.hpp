// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"
#include "rt/fd.hpp"

namespace emit::server {

/// A named piece of shared memory, /dev/shm/emitd-NAME. Its maker holds a lock on it while it
/// lives, so that others can tell a living object from what a crashed process left behind.
/// Setup only, but for alive() and has_readers(). Thread: one owner.
class ShmObject {
 public:
  ShmObject() noexcept = default;
  ShmObject(ShmObject&& other) noexcept;
  ShmObject& operator=(ShmObject&& other) noexcept;
  /// Takes the name away again if publish() gave it one.
  ~ShmObject();

  /// Zeroed, locked memory without a name yet; every page is taken here, so that none can be
  /// missing later. `mode`: permission bits. Errors (io): no room.
  [[nodiscard]] static physics::Result<ShmObject> create(std::uint64_t bytes, std::uint32_t mode);
  /// Gives the memory its name: from here on readers find it, complete. An object that a crashed
  /// process left under that name is replaced. Errors (io): a living process has the name.
  /// @pre protocol::is_shm_name(name)
  [[nodiscard]] physics::Result<void> publish(std::string_view name);

  /// Maps the object of that name for reading, and shows its maker that somebody reads. Errors:
  /// not_found, io (not permitted; its maker has gone).
  /// @pre protocol::is_shm_name(name)
  [[nodiscard]] static physics::Result<ShmObject> open(std::string_view name);
  /// True while the process that made it lives and has it open. One system call.
  [[nodiscard]] bool alive() const noexcept;
  /// Returns true while somebody has the object open by open(). One system call.
  /// @pre create() made the object
  [[nodiscard]] bool has_readers() const noexcept;

  /// Returns the memory for writing; empty unless create() made the object.
  [[nodiscard]] std::span<std::byte> writable() const noexcept { return {memory_, size_}; }
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return {memory_, size_}; }

 private:
  [[nodiscard]] physics::Result<void> map(std::uint64_t bytes, int protection);

  Fd fd_;
  std::byte* memory_ = nullptr;
  std::size_t size_ = 0;
  std::string path_;  // of publish()
};

/// Error (io) when a living process has the name; a look only.
[[nodiscard]] physics::Result<void> check_shm_name_free(std::string_view name);

}  // namespace emit::server
