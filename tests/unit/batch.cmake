octrace_test(batch_test
  SOURCES batch_journal.cpp
  LIBRARIES GTest::gmock octrace_batch
  LABELS unit)
