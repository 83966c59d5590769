#pragma once

#include <chrono>

#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle {

class State {};

namespace node_interfaces {
class LifecycleNodeInterface {
public:
    enum class CallbackReturn : std::uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
    virtual ~LifecycleNodeInterface() = default;
    virtual CallbackReturn on_configure(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_cleanup(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_activate(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_deactivate(const State &) { return CallbackReturn::SUCCESS; }
};
}  // namespace node_interfaces

class LifecycleNode {
public:
    std::map<std::string, rclcpp::Parameter> parameters;
    std::function<void(const std::string &)> wish;  // of the one topic

    std::weak_ptr<rclcpp::TimerBase> timer;  // of the one that there is
    double period = 0.0;                     // of the timer [s]

    [[nodiscard]] const char * get_name() const { return "jaw_controller"; }
    [[nodiscard]] rclcpp::Time now() const { return rclcpp::Time(1500000000LL); }
    rclcpp::node_interfaces::NodeTopicsInterface::SharedPtr get_node_topics_interface()
    {
        return topics_;
    }
    template <typename Callback>
    rclcpp::TimerBase::SharedPtr create_wall_timer(std::chrono::duration<double> each, Callback callback)
    {
        auto made = std::make_shared<rclcpp::TimerBase>();
        made->callback = callback;
        timer = made;
        period = each.count();
        return made;
    }
    [[nodiscard]] rclcpp::Logger get_logger() const { return {}; }
    [[nodiscard]] bool has_parameter(const std::string & name) const { return parameters.count(name); }
    [[nodiscard]] rclcpp::Parameter get_parameter(const std::string & name) const
    {
        return parameters.at(name);
    }
    template <typename Message, typename Callback>
    std::shared_ptr<rclcpp::Subscription<Message>> create_subscription(
        const std::string &, const rclcpp::SystemDefaultsQoS &, Callback && callback)
    {
        auto made = std::make_shared<rclcpp::Subscription<Message>>();
        made->callback = callback;
        wish = [made](const std::string & text) { made->callback(Message{text}); };
        return made;
    }

private:
    rclcpp::node_interfaces::NodeTopicsInterface::SharedPtr topics_ =
        std::make_shared<rclcpp::node_interfaces::NodeTopicsInterface>();
};

}  // namespace rclcpp_lifecycle
