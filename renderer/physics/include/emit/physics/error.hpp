// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace emit::physics {

/// List of all error codes. It generates the enum, its text and the row of the documentation.
#define EMIT_ERROR_CODES(X)                                                        \
  X(invalid_argument, "a value handed to the function is outside its valid range") \
  X(not_found, "a file, name or device does not exist")                            \
  X(io, "reading or writing failed")                                               \
  X(parse, "the content of a file or message is malformed")                        \
  X(config, "the configuration or scenario is not valid")                          \
  X(unsupported, "valid, but not handled by this build or device")                 \
  X(gpu, "the graphics device or driver refused")                                  \
  X(protocol, "a peer broke the wire protocol")                                    \
  X(internal, "a defect of emitd itself")

/// Kind of an error.
enum class ErrorCode : std::uint8_t {
#define EMIT_ERROR_ENUM(name, text) name,
  EMIT_ERROR_CODES(EMIT_ERROR_ENUM)
#undef EMIT_ERROR_ENUM
};

/// Returns the name of the code, for example "not_found".
[[nodiscard]] std::string_view to_string(ErrorCode code) noexcept;

/// Reason why an operation failed. `text` names the file, line, key, element or packet at fault.
struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string text;

  /// Puts "context: " in front of the text. Callers use it as the error travels up.
  [[nodiscard]] Error with_context(std::string_view context) && {
    text.insert(0, std::string(context) + ": ");
    return std::move(*this);
  }
};

/// A value or an Error.
template <class T>
using Result = tl::expected<T, Error>;

/// Returns an Error as the failed state of a Result.
[[nodiscard]] inline tl::unexpected<Error> make_error(ErrorCode code, std::string text) {
  return tl::unexpected<Error>(Error{code, std::move(text)});
}

}  // namespace emit::physics
