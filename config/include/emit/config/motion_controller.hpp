// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"

namespace emit::config {

/// Place in a file or device that programs share as memory.
struct MemoryPlace {
  std::filesystem::path file;      ///< absolute
  std::uint64_t offset_bytes = 0;  ///< multiple of 8
};
/// Reads "PATH@OFFSET": an absolute path, and bytes as decimal digits or hexadecimal with 0x.
/// Errors: config, naming the text.
[[nodiscard]] physics::Result<MemoryPlace> parse_memory_place(std::string_view text);

/// One way to the controller of a motion simulator; motion.controller names it.
struct MotionController {
  enum class Kind : std::uint8_t {
    udp,      ///< "address:port": messages of wire.md section 12
    memory,   ///< "memory:PATH@OFFSET": blocks of wire.md section 13
    acutrol,  ///< "acutrol:address:port": ACUTROL command language over TCP
  };
  Kind kind = Kind::udp;
  std::string address;  ///< of udp and acutrol, "address:port"
  MemoryPlace memory;   ///< of memory
};
/// Errors: config, naming the text.
[[nodiscard]] physics::Result<MotionController> parse_motion_controller(std::string_view text);

}  // namespace emit::config
