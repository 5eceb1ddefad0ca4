#include "tests/usb/rig.h"

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <mutex>
#include <utility>

namespace scatter::usb_test {

namespace {

std::mutex warnings_mutex;
std::vector<std::string>& warnings() {
  static std::vector<std::string> list;
  return list;
}

void LIBUSB_CALL take(libusb_context* /*context*/, libusb_log_level level, const char* text) {
  if (level == LIBUSB_LOG_LEVEL_ERROR || level == LIBUSB_LOG_LEVEL_WARNING) {
    const std::scoped_lock lock(warnings_mutex);
    warnings().emplace_back(text);
  }
}

/// For every context that is made after it.
[[maybe_unused]] const bool listening = [] {
  libusb_set_log_cb(nullptr, take, LIBUSB_LOG_CB_GLOBAL);
  libusb_set_option(nullptr, LIBUSB_OPTION_LOG_LEVEL, LIBUSB_LOG_LEVEL_WARNING);
  return true;
}();

}  // namespace

std::vector<std::string> take_usb_warnings() {
  const std::scoped_lock lock(warnings_mutex);
  return std::exchange(warnings(), {});
}

Host::Host() {
  Result<device::usb::Context> context = device::usb::Context::make();
  if (!context) {
    FAIL(context.error().what);
  }
  context_.emplace(std::move(*context));
  context_->add_scheme(registry_);
  (void)take_usb_warnings();
}

Host::~Host() {
  registry_ = device::TransportRegistry();
  context_.reset();
  // A closed device's last messages are still on their way to the mock.
  CHECK(soon([&] { return bus_.statistics()["under_way"] == 0; }));
  const std::vector<std::string> said = take_usb_warnings();
  if (!warnings_allowed_) {
    CHECK(said == std::vector<std::string>{});
  }
}

Result<device::Device> Host::try_open(const std::string& uri, const device::Wait& wait) const {
  device::OpenOptions options;
  options.registry = &registry_;
  options.host_name = "test";
  options.wait = wait;
  return device::Device::open(uri, options);
}

device::Device Host::open(const std::string& uri) const {
  Result<device::Device> device = try_open(uri);
  if (!device) {
    FAIL(uri << ": " << device.error().what);
  }
  return std::move(*device);
}

device::Device Host::open_soon(const std::string& uri) const {
  std::optional<device::Device> opened;
  std::string last;
  const bool there = soon([&] {
    Result<device::Device> device = try_open(uri);
    if (device) {
      opened.emplace(std::move(*device));
    } else {
      last = device.error().what;
    }
    return device.has_value();
  });
  if (!there) {
    FAIL(uri << ": " << last);
  }
  return std::move(*opened);
}

double p99(std::vector<double> samples) {
  REQUIRE_FALSE(samples.empty());
  std::sort(samples.begin(), samples.end());
  // The smallest figure with at most 1 % of the samples above it.
  return samples[samples.size() - 1 - samples.size() / 100];
}

void check_whole(const integration::Outcome& outcome, std::uint16_t frames) {
  if (outcome.error) {
    FAIL(outcome.error->what);
  }
  CHECK(outcome.frames.size() == frames);
  CHECK(outcome.complete == frames);
  CHECK(outcome.wrong == 0);
  CHECK(outcome.summary.ledger.balances());
  CHECK(outcome.summary.ledger.exposed == frames);
  CHECK(outcome.summary.ledger.delivered == frames);
  CHECK(outcome.summary.reason == protocol::RunEnd::kCompleted);
}

device::Stream start_stream(device::Device& device, const protocol::Recipe& recipe, std::uint32_t credit) {
  REQUIRE(device.configure(recipe).has_value());
  device::StartOptions options;
  options.credit_window = credit;
  Result<device::Stream> stream = device.start(options);
  REQUIRE(stream.has_value());
  return std::move(*stream);
}

protocol::Recipe endless_recipe() {
  return integration::pattern_recipe(65535);
}

}  // namespace scatter::usb_test
