// Rescue reports from bytes. What is read can be written, and reads the same; a whole report whose unused
// bytes are zero comes back byte for byte; no report is of two kinds.
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "protocol/rescue_report.h"
#include "tests/fuzz/require.h"

namespace {

using namespace scatter::protocol;
using scatter::fuzz::require;

template <typename T>
Report encoded(const T& value) {
  Report report;
  report.fill(std::byte{0xEE});
  encode(value, report);
  return report;
}

/// `used`: which bytes of a report of this kind have a meaning, as SPEC 12 says.
template <typename T, typename Decode>
void check(std::span<const std::byte> input, const T& value, Decode decode, const Report& used) {
  const Report once = encoded(value);
  const auto again = decode(std::span<const std::byte>(once));
  require(again.has_value());
  require(encoded(*again) == once);
  for (std::size_t i = 0; i < once.size(); ++i) {
    const std::byte there = i < input.size() ? input[i] : std::byte{0};
    require(once[i] == (there & used[i]));
  }
}

/// All bits of [first, end).
void use(Report& mask, std::size_t first, std::size_t end) {
  std::fill(mask.begin() + static_cast<std::ptrdiff_t>(first),
            mask.begin() + static_cast<std::ptrdiff_t>(end), std::byte{0xFF});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = std::as_bytes(std::span(data, size));
  const auto request = decode_rescue_request(input);
  const auto answer = decode_rescue_answer(input);
  const auto status = decode_rescue_status(input);
  require(!answer || !status);
  if (request) {
    Report used{};
    use(used, 0, 3);
    use(used, 4, 6);
    check(input, *request, decode_rescue_request, used);
  }
  if (answer) {
    require(answer->size <= RescueAnswer::kMostBytes);
    Report used{};
    use(used, 0, 11);
    use(used, 12, 12U + answer->size);
    check(input, *answer, decode_rescue_answer, used);
  }
  if (status) {
    Report used{};
    use(used, 0, 4);
    used[4] = std::byte{0x07};
    use(used, 8, 44);
    check(input, *status, decode_rescue_status, used);
  }
  return 0;
}
