// What the exported package uses of rclcpp, declared after its documentation, for tests without ROS.
#pragma once

#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>

namespace builtin_interfaces::msg {
struct Time {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
};
}  // namespace builtin_interfaces::msg

namespace rclcpp {

class Duration {
public:
    Duration(std::int32_t seconds, std::uint32_t nanoseconds)
        : nanoseconds_(1000000000LL * seconds + nanoseconds) {}
    static Duration from_nanoseconds(std::int64_t n) { Duration d(0, 0); d.nanoseconds_ = n; return d; }
    [[nodiscard]] double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_); }

private:
    std::int64_t nanoseconds_;
};

class Time {
public:
    explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
    [[nodiscard]] double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_); }
    [[nodiscard]] Duration operator-(const Time & other) const
    {
        return Duration::from_nanoseconds(nanoseconds_ - other.nanoseconds_);
    }
    operator builtin_interfaces::msg::Time() const
    {
        return {static_cast<std::int32_t>(nanoseconds_ / 1000000000),
                static_cast<std::uint32_t>(nanoseconds_ % 1000000000)};
    }

private:
    std::int64_t nanoseconds_;
};

class Logger {};

__attribute__((format(printf, 2, 3))) inline void said(const Logger &, const char * format, ...)
{
    va_list values;
    va_start(values, format);
    std::vfprintf(stderr, format, values);
    std::fputc('\n', stderr);
    va_end(values);
}

#define RCLCPP_ERROR(logger, ...) ::rclcpp::said(logger, __VA_ARGS__)

class Parameter {
public:
    using Value = std::variant<bool, std::int64_t, std::string>;
    explicit Parameter(Value value = false) : value_(std::move(value)) {}
    [[nodiscard]] bool as_bool() const { return std::get<bool>(value_); }
    [[nodiscard]] std::int64_t as_int() const { return std::get<std::int64_t>(value_); }
    [[nodiscard]] std::string as_string() const { return std::get<std::string>(value_); }

private:
    Value value_;
};

class SystemDefaultsQoS {};

template <typename Message>
struct Subscription {
    using SharedPtr = std::shared_ptr<Subscription<Message>>;
    std::function<void(const Message &)> callback;
};

template <typename Message>
class Publisher {
public:
    using SharedPtr = std::shared_ptr<Publisher<Message>>;
    void publish(const Message & message) { sent = message; }
    Message sent;
};

class TimerBase {
public:
    using SharedPtr = std::shared_ptr<TimerBase>;
    std::function<void()> callback;
};

class QoS {
public:
    QoS(std::size_t) {}
};

namespace node_interfaces {
class NodeTopicsInterface {
public:
    using SharedPtr = std::shared_ptr<NodeTopicsInterface>;
    std::map<std::string, std::shared_ptr<void>> publishers;  // by topic
};

class NodeParametersInterface {
public:
    using ConstSharedPtr = std::shared_ptr<const NodeParametersInterface>;
};
}  // namespace node_interfaces

template <typename Message>
std::shared_ptr<Publisher<Message>> create_publisher(
    node_interfaces::NodeTopicsInterface::SharedPtr & topics, const std::string & topic, const QoS &)
{
    auto made = std::make_shared<Publisher<Message>>();
    topics->publishers[topic] = made;
    return made;
}

}  // namespace rclcpp
