// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/row_store.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

namespace emit::renderer {
namespace {

/// Every row keeps its place and its numbers while the store grows, over many blocks.
TEST(RowStore, RowsStayWhereTheyAreWhileOthersAreAdded) {
  constexpr std::size_t kLength = 7;
  RowStore<std::size_t> store(kLength);
  std::vector<std::size_t*> places;
  // The sizes stop before, at and behind the ends of blocks (16, 48, 112, ...), the last one in a
  // block of several megabytes.
  for (const std::size_t rows : {1U, 15U, 16U, 17U, 48U, 49U, 112U, 5000U, 120000U}) {
    store.grow(rows);
    ASSERT_EQ(store.rows(), rows);
    for (std::size_t i = places.size(); i < rows; ++i) {
      ASSERT_EQ(store.row(i).size(), kLength);
      places.push_back(store.row(i).data());
      for (std::size_t k = 0; k < kLength; ++k) store.row(i)[k] = kLength * i + k;
    }
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    ASSERT_EQ(store.row(i).data(), places[i]) << i;
    for (std::size_t k = 0; k < kLength; ++k) ASSERT_EQ(store.row(i)[k], kLength * i + k) << i;
  }
}

TEST(RowStore, RowsOfNoLengthAreEmpty) {
  RowStore<float> store(0);
  store.grow(1000);
  EXPECT_EQ(store.rows(), 1000U);
  EXPECT_TRUE(store.row(999).empty());
}

TEST(RowStoreDeathTest, RefusesToShrink) {
  RowStore<float> store(3);
  store.grow(20);
  EXPECT_DEATH(store.grow(19), "rows");
}

}  // namespace
}  // namespace emit::renderer
