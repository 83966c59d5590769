#pragma once

#include "hardware_interface/handle.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"

namespace controller_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };

enum class interface_configuration_type : std::uint8_t {
    ALL = 0, INDIVIDUAL = 1, NONE = 2, INDIVIDUAL_BEST_EFFORT = 3, REGEX = 10
};

struct InterfaceConfiguration {
    interface_configuration_type type = interface_configuration_type::NONE;
    std::vector<std::string> names = {};
};

class ControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
public:
    [[nodiscard]] virtual InterfaceConfiguration command_interface_configuration() const = 0;
    [[nodiscard]] virtual InterfaceConfiguration state_interface_configuration() const = 0;
    virtual CallbackReturn on_init() = 0;
    virtual return_type update(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

    void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface> && commands,
                           std::vector<hardware_interface::LoanedStateInterface> && states)
    {
        command_interfaces_ = std::move(commands);
        state_interfaces_ = std::move(states);
    }
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
    std::shared_ptr<const rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
    [[nodiscard]] unsigned int get_update_rate() const { return update_rate; }
    unsigned int update_rate = 0;  // a test sets it

    template <typename ParameterT>
    auto auto_declare(const std::string & name, const ParameterT & otherwise)
    {
        using Kept = std::conditional_t<std::is_same_v<ParameterT, int>, std::int64_t, ParameterT>;
        node_->parameters.try_emplace(name, rclcpp::Parameter(static_cast<Kept>(otherwise)));
        return otherwise;
    }

protected:
    std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
    std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

private:
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
        std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};

}  // namespace controller_interface
