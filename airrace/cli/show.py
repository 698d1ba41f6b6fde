"""The command `airrace show`: what a checkpoint holds."""

from pathlib import Path

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile


def show(run_file: RunFile, as_json: AsJson = False) -> None:
    """Show stages, times and certificates."""
    with answering(as_json=as_json) as answer:
        from airrace.checkpoint import read_checkpoint
        from airrace.cli.mesh_table import mesh_table
        from airrace.cli.tables import rendered, result_tables, stages_table
        from airrace.runs.run_object import is_certified, run_object

        checkpoint = read_checkpoint(run_file)
        results = [stored.result for stored in checkpoint.stages]
        wall = sum(result.timings.wall for result in results)
        track = Path(checkpoint.inputs.track.path).stem
        answer.fields.update(run_object(track, results, wall, certified=is_certified(results)))
        answer.texts.append(rendered(stages_table(results)) if results else "no stage is finished yet")
        answer.texts.extend(f"{result.stage.value}: {result.message}" for result in results if result.message)
        answer.texts.extend(f"a needless loop: {loop}" for result in results for loop in result.explored.loops)
        for result in results:
            meshes = [mesh_table(result)] if len(result.mesh.why) else []
            answer.texts.extend(rendered(table) for table in [*result_tables(result), *meshes])
