// SPDX-License-Identifier: Apache-2.0
// The compiled half of Boost.Asio, once for the program (BOOST_ASIO_SEPARATE_COMPILATION).
#include <boost/asio/impl/src.hpp>
