# scatter::sodium, the one source of cryptography. On the host it is Debian's shared library. For Cortex-M7 the few
# files that check an Ed25519 signature and a SHA-512 are compiled from Debian's source package, which ./run firmware
# fetches with apt (whose signature check is the trust) into SCATTER_LIBSODIUM_SOURCE.
include_guard(GLOBAL)

set(SCATTER_LIBSODIUM_SOURCE ${PROJECT_SOURCE_DIR}/build/third_party/libsodium CACHE PATH
    "Unpacked source package of libsodium 1.0.18 (ARM builds with SCATTER_BOOTLOADER)")

function(scatter_add_libsodium)
  if(TARGET scatter::sodium)
    return()
  endif()
  if(NOT CMAKE_CROSSCOMPILING)
    find_package(PkgConfig REQUIRED)
    pkg_check_modules(sodium REQUIRED IMPORTED_TARGET GLOBAL libsodium)
    add_library(scatter::sodium ALIAS PkgConfig::sodium)
    return()
  endif()
  set(from ${SCATTER_LIBSODIUM_SOURCE}/src/libsodium)
  if(NOT EXISTS ${from}/crypto_sign/ed25519/ref10/open.c)
    message(FATAL_ERROR "libsodium's source is not in ${SCATTER_LIBSODIUM_SOURCE}, and the bootloader checks images with "
                        "it. Remedy: ./run firmware fetches it with apt-get source; or -DSCATTER_BOOTLOADER=OFF builds "
                        "without the bootloader and without updates.")
  endif()
  file(READ ${SCATTER_LIBSODIUM_SOURCE}/configure.ac configure)
  if(NOT configure MATCHES "AC_INIT\\(\\[libsodium\\],\\[([0-9.]+)\\]")
    message(FATAL_ERROR "no version of libsodium in ${SCATTER_LIBSODIUM_SOURCE}/configure.ac")
  endif()
  set(VERSION ${CMAKE_MATCH_1})
  string(REGEX MATCH "SODIUM_LIBRARY_VERSION_MAJOR=([0-9]+)" found "${configure}")
  set(SODIUM_LIBRARY_VERSION_MAJOR ${CMAKE_MATCH_1})
  string(REGEX MATCH "SODIUM_LIBRARY_VERSION_MINOR=([0-9]+)" found "${configure}")
  set(SODIUM_LIBRARY_VERSION_MINOR ${CMAKE_MATCH_1})
  set(SODIUM_LIBRARY_MINIMAL_DEF "")
  set(made ${PROJECT_BINARY_DIR}/libsodium)
  configure_file(${from}/include/sodium/version.h.in ${made}/sodium/version.h @ONLY)
  add_library(scatter_sodium STATIC
              ${from}/crypto_core/ed25519/ref10/ed25519_ref10.c ${from}/crypto_hash/sha512/cp/hash_sha512_cp.c
              ${from}/crypto_sign/ed25519/ref10/open.c ${from}/crypto_sign/ed25519/ref10/sign.c
              ${from}/crypto_verify/sodium/verify.c ${from}/sodium/utils.c)
  # The linker drops every function that the verifier does not reach: key generation, random numbers, guarded heaps.
  target_compile_definitions(scatter_sodium PRIVATE CONFIGURED=1 NATIVE_LITTLE_ENDIAN=1)
  target_include_directories(scatter_sodium SYSTEM PUBLIC ${from}/include ${made} PRIVATE ${from}/include/sodium
                             ${made}/sodium)
  # Somebody else's code: its warnings are its own.
  target_compile_options(scatter_sodium PRIVATE -w)
  add_library(scatter::sodium ALIAS scatter_sodium)
endfunction()
