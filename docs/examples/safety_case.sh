# From a hand-drawn map to a safety case; --output case.pdf prints it, where Chromium is installed.
airrace init harbour --from harbour.kml
airrace check harbour.yaml --plot harbour.png
airrace optimize harbour.yaml
airrace verify harbour.h5
airrace safety harbour.h5 --winds 0,5kt@1 --flights 40 --for "Authority" --sign-for "Race director" --output case.html
