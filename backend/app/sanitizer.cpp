// Linked into sanitizer builds only. OpenImageIO's dependencies keep a few objects of their own
// start-up for good; every leak of octrace's is still reported.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libsrt\nleak:liboflog\nleak:liblog4cplus\n";
}
extern "C" const char* __lsan_default_options() { return "print_suppressions=0"; }
