// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/mman.h>

#include <bit>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <vector>

#include "emit/physics/check.hpp"

namespace emit::renderer {

/// Rows of equal length in blocks that stay in place: adding rows moves none of them, and a row
/// that nobody writes takes no memory. Each block has twice as many rows as the one before.
/// New rows are not initialised. Threads may write different rows at the same time.
template <class Value>
class RowStore {
  static_assert(std::is_trivially_copyable_v<Value> && std::is_trivially_destructible_v<Value>);

 public:
  RowStore() = default;
  /// Begins without rows. A store whose rows have the length 0 allocates nothing.
  explicit RowStore(std::size_t length) : length_(length) {}

  /// Adds rows until there are `rows`. Errors: std::bad_alloc.
  /// @pre rows >= rows()
  void grow(std::size_t rows) {
    EMIT_CHECK_OP(rows, >=, rows_);
    rows_ = rows;
    while (length_ != 0 && first_row(blocks_.size()) < rows) {
      blocks_.push_back(make_block((kFirstRows << blocks_.size()) * length_));
    }
  }

  [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
  [[nodiscard]] std::size_t length() const noexcept { return length_; }
  [[nodiscard]] std::span<Value> row(std::size_t i) noexcept { return {at(i), length_}; }
  [[nodiscard]] std::span<const Value> row(std::size_t i) const noexcept {
    return {at(i), length_};
  }

 private:
  struct Free {
    void operator()(Value* block) const noexcept { std::free(block); }
  };
  using Block = std::unique_ptr<Value, Free>;

  static constexpr std::size_t kFirstRows = 16;
  /// Size and alignment of a huge page. The kernel is asked for these in larger blocks, because
  /// the first touch of every small page costs about a microsecond.
  static constexpr std::size_t kHugePageBytes = std::size_t{2} << 20U;

  /// Number of rows in the blocks before block `block`.
  [[nodiscard]] static constexpr std::size_t first_row(std::size_t block) noexcept {
    return kFirstRows * ((std::size_t{1} << block) - 1);
  }
  [[nodiscard]] static Block make_block(std::size_t values) {
    const std::size_t bytes = values * sizeof(Value);
    void* memory = nullptr;
    if (bytes < kHugePageBytes) {
      memory = std::malloc(bytes);
    } else {
      const std::size_t whole = (bytes + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
      memory = std::aligned_alloc(kHugePageBytes, whole);
      // The advice may fail where the kernel has no huge pages; small ones do as well.
      if (memory != nullptr) (void)::madvise(memory, whole, MADV_HUGEPAGE);
    }
    if (memory == nullptr) throw std::bad_alloc();
    return Block(static_cast<Value*>(memory));
  }
  [[nodiscard]] Value* at(std::size_t i) const noexcept {
    EMIT_DCHECK_OP(i, <, rows_);
    if (length_ == 0) return nullptr;
    const auto block = static_cast<std::size_t>(std::bit_width(i / kFirstRows + 1)) - 1;
    return blocks_[block].get() + (i - first_row(block)) * length_;
  }

  std::size_t length_ = 0;
  std::size_t rows_ = 0;
  std::vector<Block> blocks_;
};

}  // namespace emit::renderer
