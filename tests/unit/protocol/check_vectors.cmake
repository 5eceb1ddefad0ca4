# The committed golden vectors are what the independent script makes: neither was edited alone.
execute_process(COMMAND ${PYTHON} tests/golden/make_vectors.py OUTPUT_VARIABLE made RESULT_VARIABLE status)
file(READ tests/golden/protocol_vectors.json committed)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "tests/golden/make_vectors.py failed")
endif()
if(NOT made STREQUAL committed)
  message(FATAL_ERROR "tests/golden/protocol_vectors.json is not the output of make_vectors.py. When the wire "
                      "gained something, run: python3 tests/golden/make_vectors.py > tests/golden/protocol_vectors.json")
endif()
