# Cortex-M7 with double-precision FPU, no exceptions, no heap helpers. Images link without start-up files; their
# linker scripts have no symbol `end`, so that anything that wants a heap does not link.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_OBJCOPY arm-none-eabi-objcopy)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(flags_for_all
    "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -fno-math-errno -fno-unwind-tables -fno-asynchronous-unwind-tables -ffunction-sections -fdata-sections -fstack-usage -fcallgraph-info=su")
set(CMAKE_C_FLAGS_INIT "${flags_for_all}")
set(CMAKE_CXX_FLAGS_INIT
    "${flags_for_all} -fno-threadsafe-statics -fno-use-cxa-atexit -Wvla -Wdouble-promotion")
set(CMAKE_EXE_LINKER_FLAGS_INIT
    "--specs=nano.specs -nostartfiles -nodefaultlibs -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--no-warn-rwx-segments")
set(CMAKE_CXX_STANDARD_LIBRARIES_INIT "-Wl,--start-group -lm -lc -lgcc -Wl,--end-group")
