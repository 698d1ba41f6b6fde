# From a map to a safety case; --output case.pdf prints it, where Chromium is installed.
airrace init harbour --from harbour.kml
airrace check harbour.yaml
airrace optimize harbour.yaml
airrace safety harbour.h5 --flights 100 --sign-for "Race director" --output case.html
