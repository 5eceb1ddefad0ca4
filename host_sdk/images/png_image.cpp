#include "host_sdk/images/png_image.h"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csetjmp>
#include <cstring>
#include <vector>

namespace scatter::images {
namespace {

/// What libpng's callbacks work on. libpng leaves by longjmp: functions that call setjmp hold nothing that
/// has a destructor, and everything that has one lives with their callers.
struct Work {
  std::string_view input;
  std::size_t at = 0;
  std::string output;
  std::array<char, 160> problem{};
};

void on_error(png_structp png, png_const_charp words) {
  auto* const work = static_cast<Work*>(png_get_error_ptr(png));
  std::strncpy(work->problem.data(), words, work->problem.size() - 1);
  std::longjmp(png_jmpbuf(png), 1);  // NOLINT(cert-err52-cpp): libpng's way
}

void on_warning(png_structp /*png*/, png_const_charp /*words*/) {}

void on_read(png_structp png, png_bytep to, std::size_t count) {
  auto* const work = static_cast<Work*>(png_get_io_ptr(png));
  if (count > work->input.size() - work->at) {
    png_error(png, "the file ends early");
  }
  std::memcpy(to, work->input.data() + work->at, count);
  work->at += count;
}

void on_write(png_structp png, png_bytep from, std::size_t count) {
  static_cast<Work*>(png_get_io_ptr(png))->output.append(reinterpret_cast<const char*>(from), count);
}

void on_flush(png_structp /*png*/) {}

struct Reader {
  explicit Reader(Work& work)
      : png(png_create_read_struct(PNG_LIBPNG_VER_STRING, &work, on_error, on_warning)),
        info(png == nullptr ? nullptr : png_create_info_struct(png)) {}
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  png_structp png;
  png_infop info;
};

struct Writer {
  explicit Writer(Work& work)
      : png(png_create_write_struct(PNG_LIBPNG_VER_STRING, &work, on_error, on_warning)),
        info(png == nullptr ? nullptr : png_create_info_struct(png)) {}
  ~Writer() { png_destroy_write_struct(&png, &info); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  png_structp png;
  png_infop info;
};

bool read_header(const Reader& reader, Work& work) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) {  // NOLINT(cert-err52-cpp)
    return false;
  }
  png_set_read_fn(reader.png, &work, on_read);
  png_set_user_limits(reader.png, kLongestSide, kLongestSide);
  png_set_chunk_malloc_max(reader.png, 1U << 24U);
  png_set_chunk_cache_max(reader.png, 128);
  png_read_info(reader.png, reader.info);
  return true;
}

bool set_transforms(const Reader& reader) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) {  // NOLINT(cert-err52-cpp)
    return false;
  }
  png_set_expand(reader.png);  // palette to colour, 1, 2, 4 bits to 8, the transparent colour to alpha
  (void)png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  return true;
}

bool read_rows(const Reader& reader, png_bytepp rows) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) {  // NOLINT(cert-err52-cpp)
    return false;
  }
  png_read_image(reader.png, rows);
  png_read_end(reader.png, nullptr);
  return true;
}

bool write_all(const Writer& writer, Work& work, const Image& image, const PngOptions& options,
               png_bytepp rows) {
  if (setjmp(png_jmpbuf(writer.png)) != 0) {  // NOLINT(cert-err52-cpp)
    return false;
  }
  png_set_write_fn(writer.png, &work, on_write, on_flush);
  const int type = image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                   : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                         : PNG_COLOR_TYPE_RGB_ALPHA;
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(image.width),
               static_cast<png_uint_32>(image.height), options.bits, type, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (options.encoding == Encoding::kSrgb) {
    png_set_sRGB(writer.png, writer.info, PNG_sRGB_INTENT_PERCEPTUAL);
  }
  png_write_info(writer.png, writer.info);
  png_write_image(writer.png, rows);
  png_write_end(writer.png, nullptr);
  return true;
}

std::vector<png_bytep> row_pointers(std::vector<png_byte>& bytes, std::size_t row_bytes, std::size_t rows) {
  std::vector<png_bytep> pointers(rows);
  for (std::size_t y = 0; y < rows; ++y) {
    pointers[y] = bytes.data() + y * row_bytes;
  }
  return pointers;
}

/// The number that each stored one stands for.
std::vector<float> decoding_table(int bits, Encoding encoding) {
  std::vector<float> table(std::size_t{1} << static_cast<unsigned>(bits));
  for (std::size_t n = 0; n < table.size(); ++n) {
    const float value = static_cast<float>(n) / static_cast<float>(table.size() - 1);
    table[n] = encoding == Encoding::kSrgb ? srgb_to_linear(value) : value;
  }
  return table;
}

bool is_alpha(std::size_t index, std::size_t channels) {
  return channels % 2 == 0 && index % channels == channels - 1;
}

void unpack(const std::vector<png_byte>& stored, int bits, Encoding encoding, std::size_t channels,
            Image& image) {
  const std::vector<float> colours = decoding_table(bits, encoding);
  const std::vector<float> plain = decoding_table(bits, Encoding::kLinear);
  // Grey with alpha keeps the grey.
  image.channels = channels == 2 ? 1 : channels;
  image.values.resize(image.pixels() * image.channels);
  std::size_t to = 0;
  for (std::size_t n = 0; n < image.pixels() * channels; ++n) {
    const std::size_t number = bits == 8 ? stored[n] : std::size_t{stored[2 * n]} << 8U | stored[2 * n + 1];
    if (!is_alpha(n, channels)) {
      image.values[to++] = colours[number];
    } else if (channels == 4) {
      image.values[to++] = plain[number];
    }
  }
}

std::vector<png_byte> pack(const Image& image, const PngOptions& options) {
  const float most = options.bits == 8 ? 255.0F : 65535.0F;
  std::vector<png_byte> stored(image.values.size() * static_cast<std::size_t>(options.bits) / 8);
  for (std::size_t n = 0; n < image.values.size(); ++n) {
    float value = image.values[n] > 0 ? std::min(image.values[n], 1.0F) : 0.0F;
    if (options.encoding == Encoding::kSrgb && !is_alpha(n, image.channels)) {
      value = linear_to_srgb(value);
    }
    const auto number = static_cast<unsigned>(std::lround(value * most));
    if (options.bits == 8) {
      stored[n] = static_cast<png_byte>(number);
    } else {
      stored[2 * n] = static_cast<png_byte>(number >> 8U);
      stored[2 * n + 1] = static_cast<png_byte>(number & 0xFFU);
    }
  }
  return stored;
}

std::unexpected<Error> damaged(std::string_view name, const std::string& what) {
  return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, what),
              "the file is damaged or incomplete: export it again");
}

std::unexpected<Error> no_memory() {
  return fail(ErrorCode::kResourceExhausted, "no memory for libpng", "close other programs");
}

}  // namespace

Result<std::string> encode_png_image(const Image& image, const PngOptions& options) {
  if (Status status = check(image); !status) {
    return std::unexpected(status.error());
  }
  if (options.bits != 8 && options.bits != 16) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("PNG of {} bits, expected 8 or 16", options.bits),
                "choose 8 or 16");
  }
  std::vector<png_byte> stored = pack(image, options);
  std::vector<png_bytep> rows = row_pointers(stored, stored.size() / image.height, image.height);
  Work work;
  const Writer writer(work);
  if (writer.info == nullptr) {
    return no_memory();
  }
  if (!write_all(writer, work, image, options, rows.data())) {
    return fail(ErrorCode::kInternal, fmt::format("PNG encoder: {}", work.problem.data()), "report this");
  }
  return std::move(work.output);
}

Result<Image> decode_png_image(std::string_view bytes, std::string_view name, Encoding encoding) {
  Work work;
  work.input = bytes;
  const Reader reader(work);
  if (reader.info == nullptr) {
    return no_memory();
  }
  if (!read_header(reader, work)) {
    return damaged(name, work.problem.data());
  }
  Image image;
  image.width = png_get_image_width(reader.png, reader.info);
  image.height = png_get_image_height(reader.png, reader.info);
  if (image.pixels() > kMostPixels) {
    return fail(
        ErrorCode::kResourceExhausted,
        fmt::format("{}: {} x {} pixels, at most {} in all", name, image.width, image.height, kMostPixels),
        "scale it down");
  }
  // Deflate reaches 1032 : 1; asked before memory is taken.
  const double packed = static_cast<double>(png_get_rowbytes(reader.png, reader.info)) *
                        static_cast<double>(image.height) / 1032;
  if (packed > static_cast<double>(bytes.size())) {
    return damaged(name, fmt::format("claims {} x {} pixels, more than its {} bytes hold", image.width,
                                     image.height, bytes.size()));
  }
  if (!set_transforms(reader)) {
    return damaged(name, work.problem.data());
  }
  const std::size_t row_bytes = png_get_rowbytes(reader.png, reader.info);
  std::vector<png_byte> stored(row_bytes * image.height);
  std::vector<png_bytep> rows = row_pointers(stored, row_bytes, image.height);
  if (!read_rows(reader, rows.data())) {
    return damaged(name, work.problem.data());
  }
  unpack(stored, png_get_bit_depth(reader.png, reader.info), encoding,
         png_get_channels(reader.png, reader.info), image);
  return image;
}

}  // namespace scatter::images
