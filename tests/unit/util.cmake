octrace_test(util_test
  SOURCES util_atomic_file.cpp util_checked.cpp util_interrupt.cpp util_result.cpp
  LIBRARIES octrace_util fmt::fmt
  LABELS unit)
