// SPDX-License-Identifier: Apache-2.0
// Fuzz target: tables of emit evaluate.
#include "emit/physics/csv.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto table = physics::CsvTable::read(fuzz::file_of(fuzz::as_bytes(data, size)));
  if (!table) return 0;
  for (const char* column : {"T_K", "x", "kind"}) {
    const auto numbers = table->numbers(column);
    fuzz::require(!numbers || numbers->size() == table->rows(), "a number for every row");
    static_cast<void>(table->texts(column));
  }
  for (std::size_t row = 1; row < table->rows(); ++row) {
    fuzz::require(table->line_of(row - 1) < table->line_of(row), "lines go up");
  }
  return 0;
}
