// SPDX-License-Identifier: Apache-2.0
#include "rt/error_text.hpp"

#include <cerrno>
#include <system_error>

namespace emit::server {

std::string error_text(int error) {
  return std::generic_category().message(error);
}

std::string bind_error_text(int error) {
  const std::string text = error_text(error);
  return error == EADDRINUSE ? text +
                                   ": another emitd or another program holds it; `ss -ltnup` "
                                   "shows which one"
                             : text;
}

}  // namespace emit::server
