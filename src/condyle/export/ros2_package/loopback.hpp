// Hardware of ros2_control that simulates the machine by forward dynamics. Written by condyle @version@.
#pragma once

#include <array>
#include <string>

#include "hardware_interface/system_interface.hpp"
#include "numbers.hpp"
#include "rclcpp/rclcpp.hpp"

namespace @package@ {

class Loopback : public hardware_interface::SystemInterface {
public:
    hardware_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State &) override;
    hardware_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State &) override;

    // The sensors' values.
    hardware_interface::return_type read(const rclcpp::Time & time,
                                         const rclcpp::Duration & period) override;

    // One period of the scenario, under the efforts of DELAY periods ago. Until all efforts are
    // commanded, the machine stands still. ERROR where its equations have no solution.
    hardware_interface::return_type write(const rclcpp::Time & time,
                                          const rclcpp::Duration & period) override;

private:
    bool advance(const std::array<double, N> & effort);

    std::array<double, M> q_{}, q1_{};
    std::array<std::array<double, N>, DELAY + 1> asked_{};  // ring: asked for, and not acting yet
    std::array<double, N> acted_{};
    long ticks_ = 0;
    bool failed_ = false;
    std::array<std::string, N> position_, velocity_, effort_;  // names of interfaces
};

}  // namespace @package@
