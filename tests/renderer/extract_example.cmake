# SPDX-License-Identifier: Apache-2.0
# Writes the example of a header's documentation into a file that a test includes, so that the example cannot drift from
# the code. The example stands between the lines "/// @code" and "/// @endcode". Variables: HEADER, OUTPUT.
file(READ "${HEADER}" text)
string(FIND "${text}" "/// @code\n" first)
string(FIND "${text}" "/// @endcode\n" last)
if(first EQUAL -1 OR last LESS first)
  message(FATAL_ERROR "${HEADER}: no example between '/// @code' and '/// @endcode'")
endif()
string(SUBSTRING "${text}" 0 ${first} before)
string(REGEX REPLACE "[^\n]" "" line "${before}")
string(LENGTH "${line}" line)
math(EXPR first "${first} + 10")
math(EXPR line "${line} + 2")
math(EXPR length "${last} - ${first}")
string(SUBSTRING "${text}" ${first} ${length} example)
string(REGEX REPLACE "(^|\n)///[ ]?[ ]?[ ]?" "\\1" example "${example}")
file(WRITE "${OUTPUT}" "#line ${line} \"${HEADER}\"\n${example}")
