# SPDX-License-Identifier: Apache-2.0
# Every third-party library of the project, all Debian 12 packages (deploy/scripts/install_deps.sh).
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(glm REQUIRED)
find_package(tl-expected REQUIRED)
# Through pkg-config: Debian's CMake files of Imath complain about a Python module nobody needs.
pkg_check_modules(openexr REQUIRED IMPORTED_TARGET OpenEXR)
find_package(Protobuf REQUIRED)
find_package(spdlog REQUIRED)
find_package(fmt REQUIRED)
find_package(Boost 1.74 REQUIRED)
find_package(OpenSSL 3.0 REQUIRED)
find_package(CLI11 REQUIRED)
find_package(glfw3 3.3 REQUIRED)
find_package(embree 3.13 REQUIRED)
find_package(TBB REQUIRED)
find_package(meshoptimizer 0.18 REQUIRED)
find_package(GEOS 3.10 REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres REQUIRED)
pkg_check_modules(epoxy REQUIRED IMPORTED_TARGET epoxy)
pkg_check_modules(egl REQUIRED IMPORTED_TARGET egl)
pkg_check_modules(isal REQUIRED IMPORTED_TARGET libisal)
pkg_check_modules(lz4 REQUIRED IMPORTED_TARGET liblz4)
pkg_check_modules(tomlplusplus REQUIRED IMPORTED_TARGET tomlplusplus)

# Optional: libzmq3-dev and libiceoryx-posh-dev, yardsticks of `emit bench stream`.
if(EMIT_YARDSTICKS)
  pkg_check_modules(zeromq QUIET IMPORTED_TARGET libzmq)
  find_package(iceoryx_posh QUIET)
endif()

# Header-only packages without a usable config file.
find_path(EMIT_TINYGLTF_DIR tiny_gltf.h REQUIRED)
find_path(EMIT_STB_DIR stb_image_write.h PATH_SUFFIXES stb REQUIRED)
