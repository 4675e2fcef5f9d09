// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/error.hpp"

namespace emit::physics {

std::string_view to_string(ErrorCode code) noexcept {
  switch (code) {
#define EMIT_ERROR_TEXT(name, text) \
  case ErrorCode::name:             \
    return #name;
    EMIT_ERROR_CODES(EMIT_ERROR_TEXT)
#undef EMIT_ERROR_TEXT
  }
  return "unknown";
}

}  // namespace emit::physics
