// Decimal text to 32-bit floats, correctly rounded and quickly: what text formats are made of.
#pragma once

namespace scatter::formats {

/// A number at `at`: [+-]digits[.digits][(e|E)[+-]digits], one digit at least; no blanks, no hex,
/// no nan or inf.
/// Returns  where it ends, or nullptr when there is none. `value` is the float nearest to the
///          text, ties to even, as std::from_chars gives it; below the smallest float 0, above
///          the largest infinity, each with the sign.
/// Cost     about 5 ns where 19 digits and a power of ten up to 22 do, else that of from_chars.
[[nodiscard]] const char* parse_decimal(const char* at, const char* end, float& value) noexcept;

}  // namespace scatter::formats
