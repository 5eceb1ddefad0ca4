// OpenEXR by itself: an image in memory, read and written without any BRDF.
#pragma once

#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfThreading.h>

#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/images/exr_stream.h"

namespace scatter::bench {

/// Half planes of a scan line image, with its header.
class ExrImage {
 public:
  explicit ExrImage(std::string_view bytes) { read(bytes); }

  void read(std::string_view bytes) {
    images::ExrMemoryInput stream(bytes, "peer");
    Imf::InputFile file(stream, Imf::globalThreadCount());
    header_ = file.header();
    const Imath::Box2i window = header_.dataWindow();
    width_ = static_cast<std::size_t>(window.max.x) + 1;
    height_ = static_cast<std::size_t>(window.max.y) + 1;
    names_.clear();
    for (auto it = header_.channels().begin(); it != header_.channels().end(); ++it) {
      names_.emplace_back(it.name());
    }
    planes_.assign(names_.size(), std::vector<half>(width_ * height_));
    file.setFrameBuffer(buffer());
    file.readPixels(0, window.max.y);
  }

  [[nodiscard]] std::string write() {
    images::ExrMemoryOutput stream(width_ * height_ * sizeof(half));
    {
      Imf::OutputFile file(stream, header_, Imf::globalThreadCount());
      file.setFrameBuffer(buffer());
      file.writePixels(static_cast<int>(height_));
    }
    return stream.take();
  }

 private:
  [[nodiscard]] Imf::FrameBuffer buffer() {
    Imf::FrameBuffer buffer;
    for (std::size_t k = 0; k < names_.size(); ++k) {
      buffer.insert(names_[k], Imf::Slice(Imf::HALF, reinterpret_cast<char*>(planes_[k].data()), sizeof(half),
                                          sizeof(half) * width_));
    }
    return buffer;
  }

  Imf::Header header_;
  std::vector<std::string> names_;
  std::vector<std::vector<half>> planes_;
  std::size_t width_ = 0;
  std::size_t height_ = 0;
};

}  // namespace scatter::bench
