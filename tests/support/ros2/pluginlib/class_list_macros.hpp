#pragma once
// Checks what pluginlib needs: a class that can be made without arguments, of that base.
#define PLUGINLIB_EXPORT_CLASS(derived, base)                                                  \
    static_assert(std::is_base_of_v<base, derived> && std::is_default_constructible_v<derived> \
                  && !std::is_abstract_v<derived>);
