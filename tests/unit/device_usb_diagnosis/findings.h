// What the tests of the diagnosis share: a diagnosis of a made-up system, and a finding of it.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "host_sdk/device/usb/diagnosis.h"
#include "tests/unit/device_usb_diagnosis/made_up_system.h"

namespace scatter::diagnosis_test {

using device::usb::diagnose;
using device::usb::DiagnosisOptions;
using device::usb::Finding;
using Verdict = Finding::Verdict;

constexpr std::uint64_t kGigabyte = 1ULL << 30U;

inline DiagnosisOptions options_for(const MadeUpSystem& system) {
  DiagnosisOptions options;
  options.root.path = system.path();
  options.may_use = [](const std::filesystem::path&) { return true; };
  options.free_disk_bytes = 100 * kGigabyte;
  options.as_root = false;
  return options;
}

inline std::vector<Finding> findings_of(const MadeUpSystem& system) {
  return diagnose(options_for(system));
}

inline Finding the(const std::vector<Finding>& findings, const std::string& check,
                   const std::string& subject = "") {
  std::vector<Finding> found;
  std::ranges::copy_if(findings, std::back_inserter(found), [&](const Finding& each) {
    return each.check == check && (subject.empty() || each.subject == subject);
  });
  INFO(check);
  REQUIRE(found.size() == 1);
  return found.front();
}

}  // namespace scatter::diagnosis_test
