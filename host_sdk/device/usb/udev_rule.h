// The udev rule that lets whoever sits at this computer use its instruments: its text and where it belongs.
#pragma once

#include <string_view>

namespace scatter::device::usb {

inline constexpr std::string_view kUdevRuleName = "60-openscatter.rules";

/// Installs the rule that this program carries and applies it to what is plugged in. Changes nothing else.
inline constexpr std::string_view kInstallUdevRule =
    "scatter doctor --udev-rule | sudo tee /etc/udev/rules.d/60-openscatter.rules > /dev/null"
    " && sudo udevadm control --reload"
    " && sudo udevadm trigger --subsystem-match=usb --subsystem-match=hidraw";

/// Applies a rule that is installed already to what is plugged in.
inline constexpr std::string_view kApplyUdevRule =
    "sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=usb --subsystem-match=hidraw";

/// Content of tools/packaging/udev/60-openscatter.rules when the program was built.
[[nodiscard]] std::string_view udev_rule() noexcept;

}  // namespace scatter::device::usb
