// The container of RGL files: named arrays of numbers. Internal to formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::formats {

/// Bytes before the first field's entry.
inline constexpr std::size_t kTensorHeader = 18;

/// Kinds of numbers; their codes in the file are frozen.
enum class TensorType : std::uint8_t {
  kU8 = 1,
  kI8 = 2,
  kU16 = 3,
  kI16 = 4,
  kU32 = 5,
  kI32 = 6,
  kU64 = 7,
  kI64 = 8,
  kF16 = 9,
  kF32 = 10,
  kF64 = 11,
};

/// "f32".
[[nodiscard]] std::string_view name(TensorType type) noexcept;

struct TensorField {
  std::string name;
  TensorType type = TensorType::kU8;
  std::vector<std::uint64_t> shape;
  std::uint64_t offset = 0;  ///< Of the data in the file; set by the reader.
  std::string_view data;     ///< Bytes as in the file, little endian; whoever made the field keeps them.

  /// "f32[8, 32]".
  [[nodiscard]] std::string kind() const;
};

/// Fields of a file image, in its order. Their data point into `bytes`.
///
/// "tensor_file\0", u8 major 1, u8 minor, u32 number of fields; per field u16 length, name, u16
/// dimensions, u8 type, u64 offset, dimensions times u64. All little endian.
/// Errors  kDataLoss: truncated, data outside of the file, in the header or in another field's;
///         kInvalidArgument: another kind of file, an unknown type, a name twice;
///         kVersionMismatch. All name the byte.
[[nodiscard]] Result<std::vector<TensorField>> decode_tensor_file(std::string_view bytes,
                                                                  std::string_view file_name);

/// File image; data aligned to 8 bytes.
[[nodiscard]] std::string encode_tensor_file(const std::vector<TensorField>& fields);

}  // namespace scatter::formats
