// SPDX-License-Identifier: Apache-2.0
#include "app/privileges.hpp"

#include <fmt/format.h>
#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>

#include "net/socket_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

using CapabilityData = std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3>;

__user_cap_header_struct own_header() noexcept {
  return {_LINUX_CAPABILITY_VERSION_3, 0};
}

/// Returns effective and permitted capabilities together, one bit each. glibc has no wrapper for
/// the call.
std::uint64_t capabilities() noexcept {
  CapabilityData data{};
  __user_cap_header_struct header = own_header();
  if (::syscall(SYS_capget, &header, data.data()) != 0) return 0;
  const std::uint64_t low = data[0].effective | data[0].permitted;
  const std::uint64_t high = data[1].effective | data[1].permitted;
  return low | high << 32U;
}

void raise_limit(__rlimit_resource_t which, rlim_t wanted) noexcept {
  const rlimit limit{wanted, wanted};
  // This may fail: without CAP_SYS_RESOURCE the limits are the administrator's (LimitRTPRIO=).
  static_cast<void>(::setrlimit(which, &limit));
}

std::string limit_text(__rlimit_resource_t which) {
  rlimit limit{};
  if (::getrlimit(which, &limit) != 0) return "?";
  return limit.rlim_cur == RLIM_INFINITY ? "unlimited" : fmt::format("{}", limit.rlim_cur);
}

}  // namespace

physics::Result<std::string> drop_privileges() {
  const std::uint64_t before = capabilities();
  constexpr rlim_t kMaxPriority = 99;
  raise_limit(RLIMIT_RTPRIO, kMaxPriority);
  raise_limit(RLIMIT_MEMLOCK, RLIM_INFINITY);

  for (int capability = 0; ::prctl(PR_CAPBSET_READ, capability, 0, 0, 0) >= 0; ++capability) {
    // This needs CAP_SETPCAP. Without it NO_NEW_PRIVS does the same.
    static_cast<void>(::prctl(PR_CAPBSET_DROP, capability, 0, 0, 0));
  }
  // The error EINVAL means a kernel without ambient capabilities, which has none to clear.
  if (::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0) != 0 && errno != EINVAL) {
    return physics::make_error(physics::ErrorCode::internal,
                               "ambient capabilities: " + error_text(errno));
  }
  const CapabilityData none{};
  __user_cap_header_struct header = own_header();
  if (::syscall(SYS_capset, &header, none.data()) != 0 ||
      ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
    return physics::make_error(physics::ErrorCode::internal,
                               "giving up privileges: " + error_text(errno));
  }
  if (const std::uint64_t left = capabilities(); left != 0) {
    return physics::make_error(physics::ErrorCode::internal,
                               fmt::format("capabilities {:#x} could not be given up", left));
  }
  return fmt::format(
      "event=privileges_dropped capabilities_before={:#x} capabilities_kept=none uid={} "
      "no_new_privs=yes rtprio_limit={} memlock_limit={}",
      before, ::getuid(), limit_text(RLIMIT_RTPRIO), limit_text(RLIMIT_MEMLOCK));
}

}  // namespace emit::server
