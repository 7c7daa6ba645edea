# Bundles the page: cmake -D NPM= SOURCE= WORK= PAGE= REQUIRED= -P bundle.cmake. Packages are
# installed under WORK, and again only when package-lock.json has changed.

function(give_up what output)
  file(REMOVE_RECURSE ${PAGE})
  if(REQUIRED STREQUAL "ON")
    message(FATAL_ERROR "${what}:\n${output}")
  endif()
  message(WARNING "${what}; the monitor's web page is not built:\n${output}")
endfunction()

set(installed ${WORK}/installed-lock.json)
set(up_to_date 1)
if(EXISTS ${installed})
  execute_process(COMMAND ${CMAKE_COMMAND} -E compare_files ${installed}
                          ${SOURCE}/package-lock.json RESULT_VARIABLE up_to_date ERROR_QUIET)
endif()
if(NOT up_to_date EQUAL 0)
  file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json DESTINATION ${WORK})
  # Scripts of packages are not run; nothing here needs them.
  execute_process(
    COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --fetch-retries=1
            --fetch-timeout=30000
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    give_up("npm cannot install the page's packages" "${output}")
    return()
  endif()
  configure_file(${SOURCE}/package-lock.json ${installed} COPYONLY)
endif()

file(REMOVE_RECURSE ${PAGE})
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env NODE_PATH=${WORK}/node_modules
          ${WORK}/node_modules/.bin/esbuild ${SOURCE}/src/main.ts --bundle --minify --format=esm
          --target=es2022 --legal-comments=eof --log-level=warning --outfile=${PAGE}/app.js
  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "esbuild failed:\n${output}")
endif()
file(COPY ${SOURCE}/index.html ${SOURCE}/icon.svg DESTINATION ${PAGE})
