// The way out of a test image: words and an exit status by Arm semihosting, which the emulator answers.
#pragma once

#include <cstdint>

namespace scatter::firmware::semihosting {

inline std::uint32_t call(std::uint32_t operation, const void* argument) noexcept {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory", "cc");
  return r0;
}

/// To the emulator's standard error.
inline void print(const char* text) noexcept {
  (void)call(0x04, text);
}
inline void print(std::uint32_t number) noexcept {
  char digits[11]{};
  char* at = digits + 10;
  do {
    *--at = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  print(at);
}

[[noreturn]] inline void exit(std::uint32_t status) noexcept {
  const std::uint32_t arguments[2] = {0x20026, status};
  for (;;) {
    (void)call(0x20, arguments);
  }
}

/// Ends the image with status 1 unless `holds`.
inline void check(bool holds, const char* what) noexcept {
  if (!holds) {
    print("failed: ");
    print(what);
    print("\n");
    exit(1);
  }
}

}  // namespace scatter::firmware::semihosting
