// OpenEXR streams in memory. For images and formats: includes OpenEXR.
#pragma once

#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace scatter::images {

/// Reads bytes that the caller keeps alive. Throws at the end, as OpenEXR expects.
class ExrMemoryInput final : public Imf::IStream {
 public:
  ExrMemoryInput(std::string_view bytes, const char* name) : IStream(name), bytes_(bytes) {}

  [[nodiscard]] bool isMemoryMapped() const override { return true; }
  char* readMemoryMapped(int n) override {
    need(n);
    // OpenEXR's interface lacks the const; it only reads.
    char* at = const_cast<char*>(bytes_.data()) + at_;
    at_ += static_cast<std::uint64_t>(n);
    return at;
  }
  bool read(char c[], int n) override {
    need(n);
    std::memcpy(c, bytes_.data() + at_, static_cast<std::size_t>(n));
    at_ += static_cast<std::uint64_t>(n);
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t pos) override { at_ = pos; }

 private:
  void need(int n) const {
    if (n < 0 || at_ > bytes_.size() || static_cast<std::uint64_t>(n) > bytes_.size() - at_) {
      throw std::runtime_error("the file ends early at byte " + std::to_string(bytes_.size()) +
                               ": expected " + std::to_string(n) + " bytes at byte " + std::to_string(at_));
    }
  }
  std::string_view bytes_;
  std::uint64_t at_ = 0;
};

/// Collects what OpenEXR writes, seeks included.
class ExrMemoryOutput final : public Imf::OStream {
 public:
  explicit ExrMemoryOutput(std::size_t expected_size) : OStream("memory") { bytes_.reserve(expected_size); }

  void write(const char c[], int n) override {
    const std::size_t end = at_ + static_cast<std::size_t>(n);
    if (end > bytes_.size()) {
      bytes_.resize(end);
    }
    std::memcpy(bytes_.data() + at_, c, static_cast<std::size_t>(n));
    at_ = end;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t pos) override { at_ = static_cast<std::size_t>(pos); }

  [[nodiscard]] std::string take() noexcept { return std::move(bytes_); }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

/// Bytes that the pixels of an image have at least.
/// Deflate, the best packer among EXR's lossless ones, reaches 1032 : 1.
[[nodiscard]] inline double least_bytes(const Imf::Header& header, std::size_t planes) {
  const Imath::Box2i& window = header.dataWindow();
  const double width = static_cast<double>(window.max.x) - window.min.x + 1;
  const double height = static_cast<double>(window.max.y) - window.min.y + 1;
  const double least = header.compression() == Imf::NO_COMPRESSION ? 2.0 : 0.0019;
  return width * height * static_cast<double>(planes) * least;
}

/// False when an image claims more than its file can hold: asked before memory is taken.
[[nodiscard]] inline bool can_hold(const Imf::Header& header, std::size_t planes, std::size_t file_size) {
  return least_bytes(header, planes) <= static_cast<double>(file_size);
}

/// For messages about an image that its file cannot hold.
[[nodiscard]] inline std::string ends_early(const Imf::Header& header, std::size_t planes,
                                            std::size_t file_size) {
  return fmt::format("byte {}: the file ends early: expected at least {:.0f} bytes of pixels", file_size,
                     least_bytes(header, planes));
}

}  // namespace scatter::images
