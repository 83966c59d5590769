// Interfaces between controllers and hardware, as far as the exported package uses them.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace hardware_interface {

class Handle {
public:
    using SharedPtr = std::shared_ptr<Handle>;
    explicit Handle(std::string name) : name_(std::move(name)) {}
    [[deprecated]] Handle(const std::string & prefix, const std::string & name, double *)
        : name_(prefix + "/" + name) {}
    [[nodiscard]] const std::string & get_name() const { return name_; }
    [[nodiscard]] std::optional<double> get_optional() const { return value_; }
    [[nodiscard]] bool set_value(double value)
    {
        value_ = value;
        return true;
    }

private:
    std::string name_;
    double value_ = std::numeric_limits<double>::quiet_NaN();
};

using StateInterface = Handle;
using CommandInterface = Handle;

class LoanedStateInterface {
public:
    explicit LoanedStateInterface(Handle::SharedPtr of) : of_(std::move(of)) {}
    LoanedStateInterface(const LoanedStateInterface &) = delete;
    LoanedStateInterface(LoanedStateInterface &&) = default;
    [[nodiscard]] const std::string & get_name() const { return of_->get_name(); }
    template <typename T = double>
    [[nodiscard]] std::optional<T> get_optional(unsigned = 10) const
    {
        return of_->get_optional();
    }

private:
    Handle::SharedPtr of_;
};

class LoanedCommandInterface : public LoanedStateInterface {
public:
    explicit LoanedCommandInterface(Handle::SharedPtr of)
        : LoanedStateInterface(of), to_(std::move(of)) {}
    LoanedCommandInterface(LoanedCommandInterface &&) = default;
    template <typename T>
    [[nodiscard]] bool set_value(const T & value, unsigned = 10)
    {
        return to_->set_value(value);
    }

private:
    Handle::SharedPtr to_;
};

}  // namespace hardware_interface
