// Numbers that never change and that several objects may hold at once.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace scatter::reflectance {

/// Floats of a vector, or a part of a larger block such as the image of a file. A copy shares them.
///
/// Threads   may be read, copied and destroyed from any number of threads.
class SharedFloats {
 public:
  SharedFloats() = default;
  // Implicit: a table is filled as a vector and then handed over.
  SharedFloats(std::vector<float> values) {  // NOLINT(google-explicit-constructor)
    auto owner = std::make_shared<const std::vector<float>>(std::move(values));
    values_ = *owner;
    owner_ = std::move(owner);
  }
  /// `values` lie in what `owner` keeps, and nobody changes them.
  SharedFloats(std::shared_ptr<const void> owner, std::span<const float> values) noexcept
      : owner_(std::move(owner)), values_(values) {}
  SharedFloats(const SharedFloats&) = default;
  SharedFloats& operator=(const SharedFloats&) = default;
  SharedFloats(SharedFloats&& other) noexcept
      : owner_(std::move(other.owner_)), values_(std::exchange(other.values_, {})) {}
  SharedFloats& operator=(SharedFloats&& other) noexcept {
    owner_ = std::move(other.owner_);
    values_ = std::exchange(other.values_, {});
    return *this;
  }
  ~SharedFloats() = default;

  [[nodiscard]] const float* data() const noexcept { return values_.data(); }
  [[nodiscard]] std::size_t size() const noexcept { return values_.size(); }
  [[nodiscard]] float operator[](std::size_t k) const noexcept { return values_[k]; }
  [[nodiscard]] auto begin() const noexcept { return values_.begin(); }
  [[nodiscard]] auto end() const noexcept { return values_.end(); }

 private:
  std::shared_ptr<const void> owner_;
  std::span<const float> values_;
};

}  // namespace scatter::reflectance
