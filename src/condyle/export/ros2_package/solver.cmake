
find_package(Eigen3 REQUIRED)
find_package(inverse_dynamics_solver REQUIRED)
add_library(@package@_solver SHARED src/solver.cpp src/@solver@.c)
target_include_directories(@package@_solver PRIVATE ${inverse_dynamics_solver_INCLUDE_DIRS})
target_link_libraries(@package@_solver PRIVATE Eigen3::Eigen pluginlib::pluginlib rclcpp::rclcpp m)
pluginlib_export_plugin_description_file(inverse_dynamics_solver solver_plugin.xml)
list(APPEND PLUGINS @package@_solver)
