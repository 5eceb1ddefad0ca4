// What a text format has no keyword for, carried in its comments. Internal to formats.
//
//   # scatter.KEY: VALUE
//   # scatter.KEY+ more of the VALUE of the line before
//
// KEY and VALUE are one line of bytes each: backslash, control characters, blanks at either end and,
// in keys, ':' '+' '@' and blanks are written \xHH. Keys of metadata are free; a key that begins
// with '@' is ours: "@origin", "@wavelengths_nm".
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// Fields of a file's comments.
struct CommentFields {
  std::map<std::string, std::string> metadata;
  std::map<std::string, std::string> own;  ///< Keys without the '@'.
  std::string foreign;                     ///< Comments of others, one per line, without "#" and blanks.
};

/// Appends lines to `out`.
void write_comment_fields(const std::map<std::string, std::string>& metadata,
                          const std::map<std::string, std::string>& own, std::string& out);

/// From TextScanner::comments(). A field that comes twice: the last one counts.
/// Errors  kDataLoss: a field of ours that is damaged; the message has no file name.
[[nodiscard]] Result<CommentFields> read_comment_fields(std::span<const std::string_view> comments);

/// "300*1 20*3": 300 measured nodes, then 20 extrapolated ones.
[[nodiscard]] std::string origin_runs(std::span<const reflectance::Origin> origin);
/// Errors  kDataLoss: other than `expected` nodes; the message has no file name.
[[nodiscard]] Result<std::vector<reflectance::Origin>> read_origin_runs(std::string_view runs,
                                                                        std::size_t expected);

/// "630 525 465".
[[nodiscard]] std::string float_list(std::span<const float> values);
/// Errors  kDataLoss: other than `expected` numbers; the message has no file name.
[[nodiscard]] Result<std::vector<float>> read_float_list(std::string_view text, std::size_t expected);

}  // namespace scatter::formats
