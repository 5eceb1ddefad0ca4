#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/merl_layout.h"

namespace scatter::formats {
namespace {

using reflectance::HalfDifferenceBrdf;

constexpr std::size_t kBuffer = 64 * 1024;
constexpr std::uint64_t kMostCells = std::uint64_t{1} << 27;
constexpr const char* kRemedy = "download or export the file again";
static_assert(std::endian::native == std::endian::little, "the doubles of the file are taken as they are");

std::unexpected<Error> damaged(std::string_view name, std::uint64_t at, const std::string& what) {
  return fail(ErrorCode::kDataLoss, fmt::format("{}: byte {}: {}", name, at, what), kRemedy);
}

/// What was exported on a machine of the other byte order.
bool looks_big_endian(const std::array<std::int32_t, 3>& count) noexcept {
  return std::ranges::all_of(count, [](std::int32_t n) {
    const std::uint32_t turned = std::byteswap(static_cast<std::uint32_t>(n));
    return turned >= 1 && turned <= 10'000;
  });
}

/// Empty table of the size that the header says, held against the file's size.
Result<HalfDifferenceBrdf::Content> prepare(std::string_view header, std::uint64_t file_size,
                                            std::string_view name) {
  if (header.size() < kMerlHeader) {
    return damaged(name, header.size(), fmt::format("expected three counts in {} bytes", kMerlHeader));
  }
  std::array<std::int32_t, 3> count{};
  std::memcpy(count.data(), header.data(), kMerlHeader);
  if (looks_big_endian(count)) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("{}: byte 0: the counts are {} x {} x {} in big-endian order, expected little-endian "
                    "90 x 90 x 180",
                    name, std::byteswap(static_cast<std::uint32_t>(count[0])),
                    std::byteswap(static_cast<std::uint32_t>(count[1])),
                    std::byteswap(static_cast<std::uint32_t>(count[2]))),
        "export it again in little-endian order");
  }
  std::uint64_t cells = 1;
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (count[k] < 1 || static_cast<std::uint64_t>(count[k]) > kMostCells / cells) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: byte {}: {} x {} x {} cells, expected 90 x 90 x 180", name, 4 * k,
                              count[0], count[1], count[2]),
                  "check that it is a MERL file");
    }
    cells *= static_cast<std::uint64_t>(count[k]);
  }
  const bool standard = cells == kMerlCells;
  const bool reciprocal = standard || count[2] == 2 * std::int64_t{count[1]};
  if (!reciprocal && count[2] != 4 * std::int64_t{count[1]}) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: byte 8: {} x {} x {} cells, expected 90 x 90 x 180 or 90 x 90 x 360", name,
                            count[0], count[1], count[2]),
                "check that it is a MERL file");
  }
  const std::uint64_t expected = kMerlHeader + cells * kMerlScale.size() * sizeof(double);
  if (file_size != expected) {
    return damaged(name, std::min(file_size, expected),
                   fmt::format("the file has {} bytes, {} x {} x {} cells need {}", file_size, count[0],
                               count[1], count[2], expected));
  }
  HalfDifferenceBrdf::Content content;
  content.theta_h_count = static_cast<std::size_t>(count[0]);
  content.theta_d_count = static_cast<std::size_t>(count[1]);
  content.phi_d_count = static_cast<std::size_t>(count[2]);
  content.reciprocal = reciprocal;
  content.channels = kMerlScale.size();
  content.f_per_sr.resize(cells * kMerlScale.size());
  return content;
}

/// Doubles of the file, from `from` on in the list of all values, into the table.
void convert(const char* bytes, std::size_t from, std::size_t count, HalfDifferenceBrdf::Content& content) {
  const std::size_t cells = content.cells();
  while (count > 0) {
    const std::size_t channel = from / cells;
    const std::size_t here = std::min(count, (channel + 1) * cells - from);
    const double scale = kMerlScale[channel];
    float* out = content.f_per_sr.data() + from;
    for (std::size_t k = 0; k < here; ++k) {
      double value = 0;
      std::memcpy(&value, bytes + k * sizeof(double), sizeof(double));
      out[k] = static_cast<float>(value * scale);
    }
    bytes += here * sizeof(double);
    from += here;
    count -= here;
  }
}

/// The first double that is no finite float, as it stands in the file; nullopt: none.
std::optional<Error> wrong_value(std::string_view bytes, std::string_view name) {
  const std::size_t count = bytes.size() < kMerlHeader ? 0 : (bytes.size() - kMerlHeader) / sizeof(double);
  for (std::size_t k = 0; k < count; ++k) {
    double value = 0;
    const std::size_t at = kMerlHeader + k * sizeof(double);
    std::memcpy(&value, bytes.data() + at, sizeof(double));
    const double scale = kMerlScale[std::min(k / std::max<std::size_t>(count / 3, 1), std::size_t{2})];
    if (!std::isfinite(static_cast<float>(value * scale))) {
      return damaged(name, at,
                     fmt::format("value {} is {}, expected a finite number below {:.3g}", k, value,
                                 static_cast<double>(std::numeric_limits<float>::max()) / scale))
          .error();
    }
  }
  return std::nullopt;
}

Result<HalfDifferenceBrdf> finish(HalfDifferenceBrdf::Content content, std::string_view name) {
  auto brdf = HalfDifferenceBrdf::make(std::move(content));
  if (!brdf) {
    brdf.error().code = ErrorCode::kDataLoss;
    brdf.error().what = fmt::format("{}: {}", name, brdf.error().what);
  }
  return brdf;
}

}  // namespace

Result<HalfDifferenceBrdf> decode_merl(std::string_view bytes, std::string_view name) {
  auto content = prepare(bytes.substr(0, kMerlHeader), bytes.size(), name);
  if (!content) {
    return std::unexpected(content.error());
  }
  convert(bytes.data() + kMerlHeader, 0, content->f_per_sr.size(), *content);
  auto brdf = finish(std::move(*content), name);
  if (!brdf) {
    if (auto wrong = wrong_value(bytes, name)) {
      return std::unexpected(std::move(*wrong));
    }
  }
  return brdf;
}

Result<HalfDifferenceBrdf> read_merl(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size =
      std::filesystem::is_regular_file(path, error) ? std::filesystem::file_size(path, error) : 0;
  std::ifstream in;
  // The buffer is ours: a second one inside would only be copied from.
  in.rdbuf()->pubsetbuf(nullptr, 0);
  if (size != 0) {  // Else it may be a pipe, where opening waits for somebody who writes.
    in.open(path, std::ios::binary);
  }
  if (error || size == 0 || !in) {
    // The whole-file reader knows what is wrong with the path.
    const auto bytes = read_file(path);
    return bytes ? decode_merl(*bytes, path.string()) : std::unexpected(bytes.error());
  }
  std::array<char, kMerlHeader> header{};
  in.read(header.data(), header.size());
  auto content = prepare({header.data(), static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0))},
                         size, path.string());
  if (!content) {
    return std::unexpected(content.error());
  }
  std::vector<char> buffer(kBuffer);
  const std::size_t values = content->f_per_sr.size();
  for (std::size_t from = 0; from < values;) {
    const std::size_t count = std::min(values - from, kBuffer / sizeof(double));
    in.read(buffer.data(), static_cast<std::streamsize>(count * sizeof(double)));
    if (static_cast<std::size_t>(in.gcount()) != count * sizeof(double)) {
      return damaged(path.string(), kMerlHeader + from * sizeof(double),
                     "the file became shorter while it was read");
    }
    convert(buffer.data(), from, count, *content);
    from += count;
  }
  auto brdf = finish(std::move(*content), path.string());
  if (!brdf) {
    const auto bytes = read_file(path);
    if (auto wrong = bytes ? wrong_value(*bytes, path.string()) : std::nullopt) {
      return std::unexpected(std::move(*wrong));
    }
  }
  return brdf;
}

}  // namespace scatter::formats
