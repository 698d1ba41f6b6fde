"""Input files: YAML documents of a run, read strictly, with errors that name file, line and key."""

from airrace.files.inputs.document import Document
from airrace.files.inputs.inputs import Inputs, inputs_from_documents, load_inputs, read_documents

__all__ = ["Document", "Inputs", "inputs_from_documents", "load_inputs", "read_documents"]
