#include "host_sdk/images/exr_image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <fmt/format.h>

#include <Imath/half.h>

#include <exception>
#include <vector>

#include "host_sdk/images/exr_header.h"
#include "host_sdk/images/exr_stream.h"
#include "host_sdk/images/exr_threads.h"

namespace scatter::images {
namespace {

std::vector<std::string> channel_names(std::size_t channels) {
  static const std::vector<std::string> kColours = {"R", "G", "B", "A"};
  return channels == 1
             ? std::vector<std::string>{"Y"}
             : std::vector<std::string>(kColours.begin(), kColours.begin() + static_cast<long>(channels));
}

/// The names to read, in order; empty when the image is none of ours.
std::vector<std::string> names_to_read(const Imf::ChannelList& list) {
  const auto has = [&list](const char* name) { return list.findChannel(name) != nullptr; };
  if (has("R") && has("G") && has("B")) {
    return channel_names(has("A") ? 4 : 3);
  }
  if (has("Y") && !has("RY") && !has("BY")) {
    return {"Y"};
  }
  auto first = list.begin();
  if (first == list.end() || ++list.begin() != list.end()) {
    return {};
  }
  return {first.name()};
}

std::string all_names(const Imf::ChannelList& list) {
  std::string names;
  std::size_t count = 0;
  for (auto it = list.begin(); it != list.end(); ++it, ++count) {
    if (count < 8) {
      names += fmt::format("{}{}", count == 0 ? "" : ", ", it.name());
    }
  }
  return count > 8 ? fmt::format("{} and {} more", names, count - 8) : names;
}

Result<Image> decode(std::string_view bytes, const std::string& name) {
  ExrMemoryInput stream(bytes, name.c_str());
  Imf::InputFile file(stream, exr_threads());
  const Imf::Header& header = file.header();
  const std::vector<std::string> names = names_to_read(header.channels());
  if (names.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: channels are {}, expected R, G, B or Y or a single one", name,
                            all_names(header.channels())),
                "save it as an RGB or a grey image");
  }
  for (const std::string& channel : names) {
    const Imf::Channel& found = header.channels()[channel.c_str()];
    if (found.xSampling != 1 || found.ySampling != 1) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: channel {} is sampled every {} x {} pixels, expected 1 x 1", name, channel,
                              found.xSampling, found.ySampling),
                  "save it without subsampling");
    }
  }
  std::size_t planes = 0;
  for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
    ++planes;
  }
  const Imath::Box2i& window = header.dataWindow();
  Image image;
  image.width = static_cast<std::size_t>(std::int64_t{window.max.x} - window.min.x + 1);
  image.height = static_cast<std::size_t>(std::int64_t{window.max.y} - window.min.y + 1);
  image.channels = names.size();
  if (image.width > kLongestSide || image.height > kLongestSide || image.pixels() > kMostPixels) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("{}: {} x {} pixels, at most {} a side and {} in all", name, image.width,
                            image.height, kLongestSide, kMostPixels),
                "scale it down");
  }
  if (!can_hold(header, planes, bytes.size())) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("{}: {} for {} x {} pixels of {} channels", name,
                            ends_early(header, planes, bytes.size()), image.width, image.height, planes),
                "the file is damaged or incomplete: export it again");
  }
  image.values.resize(image.pixels() * image.channels);
  Imf::FrameBuffer buffer;
  const std::size_t stride = sizeof(float) * image.channels;
  for (std::size_t c = 0; c < names.size(); ++c) {
    buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.values.data() + c, window, stride,
                                             stride * image.width));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return image;
}

}  // namespace

Result<std::string> encode_exr_image(const Image& image, ExrPixel pixel) {
  if (Status status = check(image); !status) {
    return std::unexpected(status.error());
  }
  try {
    const std::vector<std::string> names = channel_names(image.channels);
    Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    std::vector<half> halves;
    const bool small = pixel == ExrPixel::kHalf;
    if (small) {
      halves.reserve(image.values.size());
      for (const float value : image.values) {
        halves.emplace_back(value);
      }
    }
    const std::size_t size = small ? sizeof(half) : sizeof(float);
    // OpenEXR's interface lacks the const; it only reads.
    char* const data = small ? reinterpret_cast<char*>(halves.data())
                             : const_cast<char*>(reinterpret_cast<const char*>(image.values.data()));
    for (std::size_t c = 0; c < names.size(); ++c) {
      const Imf::PixelType type = small ? Imf::HALF : Imf::FLOAT;
      header.channels().insert(names[c], Imf::Channel(type));
      buffer.insert(names[c], Imf::Slice(type, data + c * size, size * image.channels,
                                         size * image.channels * image.width));
    }
    ExrMemoryOutput stream(image.values.size() * size / 2 + 4096);
    {
      Imf::OutputFile file(stream, header, exr_threads());
      file.setFrameBuffer(buffer);
      file.writePixels(static_cast<int>(image.height));
    }
    return stream.take();
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, fmt::format("EXR encoder: {}", error.what()), "report this");
  }
}

Result<Image> decode_exr_image(std::string_view bytes, std::string_view name) {
  if (Status status = check_exr_header(bytes, name); !status) {
    return std::unexpected(status.error());
  }
  try {
    return decode(bytes, std::string(name));
  } catch (const std::exception& error) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, error.what()),
                "the file is damaged or incomplete: export it again");
  }
}

}  // namespace scatter::images
