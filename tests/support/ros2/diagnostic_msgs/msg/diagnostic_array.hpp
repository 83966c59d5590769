#pragma once
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"

namespace diagnostic_msgs::msg {
struct KeyValue {
    std::string key, value;
};
struct DiagnosticStatus {
    static constexpr unsigned char OK = 0, WARN = 1, ERROR = 2, STALE = 3;
    unsigned char level = 0;
    std::string name, message, hardware_id;
    std::vector<KeyValue> values;
};
struct Header {
    builtin_interfaces::msg::Time stamp;
    std::string frame_id;
};
struct DiagnosticArray {
    Header header;
    std::vector<DiagnosticStatus> status;
};
}  // namespace diagnostic_msgs::msg
