// SPDX-License-Identifier: Apache-2.0
#include "rt/error_text.hpp"

#include <system_error>

namespace emit::server {

std::string error_text(int error) {
  return std::generic_category().message(error);
}

}  // namespace emit::server
