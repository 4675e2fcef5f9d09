// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sstream>
#include <string>

/// Checks of contracts. A failed check is an error in the program, not in its input. The program
/// logs the place and the operands through the panic handler and aborts.
///
///   EMIT_CHECK(ready)              is always on
///   EMIT_CHECK_OP(index, <, size)  is always on; the message holds both operands
///   EMIT_DCHECK(...), EMIT_DCHECK_OP(...)  are on only in debug, sanitizer and fuzzing builds, for
///                                  the innermost loops; other builds do not evaluate the operands
///
/// Every `@pre` of a public function is checked by one of these.
namespace emit::physics {

/// A function that takes the text of a failed check. It may throw (tests do). If it returns, the
/// program aborts.
using PanicHandler = void (*)(const char* message);

/// Replaces the panic handler and returns the previous one. The default handler writes to standard
/// error; nullptr restores it.
/// Thread: any. All threads see the change.
PanicHandler set_panic_handler(PanicHandler handler) noexcept;

/// Passes "file:line: message" to the handler and aborts. Thread: any.
[[noreturn]] void panic(const char* file, int line, const std::string& message);

namespace detail {

template <class A, class B>
[[noreturn, gnu::cold, gnu::noinline]] void panic_op(const char* file, int line, const char* text,
                                                     const A& a, const char* operation,
                                                     const B& b) {
  std::ostringstream message;
  message << "check failed: " << text << " (" << +a << ' ' << operation << ' ' << +b << ')';
  panic(file, line, message.str());
}
[[noreturn, gnu::cold, gnu::noinline]] inline void panic_condition(const char* file, int line,
                                                                   const char* text) {
  panic(file, line, std::string("check failed: ") + text);
}

}  // namespace detail
}  // namespace emit::physics

#define EMIT_CHECK(condition)   \
  (static_cast<bool>(condition) \
       ? void(0)                \
       : ::emit::physics::detail::panic_condition(__FILE__, __LINE__, #condition))
/// Both operands must be numbers. They are evaluated a second time for the message.
#define EMIT_CHECK_OP(a, operation, b)                    \
  (((a)operation(b)) ? void(0)                            \
                     : ::emit::physics::detail::panic_op( \
                           __FILE__, __LINE__, #a " " #operation " " #b, (a), #operation, (b)))

#if defined(EMIT_DCHECKS) || !defined(NDEBUG)
#define EMIT_DCHECK(condition) EMIT_CHECK(condition)
#define EMIT_DCHECK_OP(a, operation, b) EMIT_CHECK_OP(a, operation, b)
#else
#define EMIT_DCHECK(condition) static_cast<void>(sizeof(static_cast<bool>(condition)))
#define EMIT_DCHECK_OP(a, operation, b) static_cast<void>(sizeof((a)operation(b)))
#endif
