octrace_test(batch_test
  SOURCES batch_journal.cpp batch_paths.cpp batch_scratch.cpp
  LIBRARIES GTest::gmock octrace_batch
  LABELS unit)
octrace_test(batch_files_test
  SOURCES batch_annotations.cpp batch_cameras.cpp batch_objects.cpp render_scene.cpp
  LIBRARIES GTest::gmock octrace_batch
  LABELS unit)
