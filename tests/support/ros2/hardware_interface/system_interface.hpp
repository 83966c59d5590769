#pragma once

#include "hardware_interface/handle.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"

namespace hardware_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

enum class return_type : std::uint8_t { OK = 0, ERROR = 1, DEACTIVATE = 2 };

class HardwareComponentInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
public:
    HardwareComponentInterface() = default;
    HardwareComponentInterface(const HardwareComponentInterface &) = delete;

    [[deprecated]] virtual std::vector<StateInterface> export_state_interfaces() { return {}; }
    [[deprecated]] virtual std::vector<CommandInterface> export_command_interfaces() { return {}; }
    virtual return_type read(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
    virtual return_type write(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

    [[nodiscard]] virtual bool has_state(const std::string & name) const { return states.count(name); }
    [[nodiscard]] virtual bool has_command(const std::string & name) const
    {
        return commands.count(name);
    }
    template <typename T>
    void set_state(const std::string & name, const T & value) { put(states, name, value); }
    template <typename T>
    void set_command(const std::string & name, const T & value) { put(commands, name, value); }
    template <typename T = double>
    [[nodiscard]] T get_command(const std::string & name) const
    {
        return commands.at(name)->get_optional().value();
    }
    [[nodiscard]] virtual rclcpp::Logger get_logger() const { return {}; }

    // The framework makes these after the URDF; here a test does.
    std::map<std::string, Handle::SharedPtr> states, commands;

private:
    static void put(std::map<std::string, Handle::SharedPtr> & to, const std::string & name, double x)
    {
        if (!to.at(name)->set_value(x)) throw std::runtime_error(name);
    }
};

class SystemInterface : public HardwareComponentInterface {};

}  // namespace hardware_interface
